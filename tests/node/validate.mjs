// Prints what Khronos' glTF validator finds in a file, as JSON.
import { readFileSync } from 'node:fs';
import validator from 'gltf-validator';

const bytes = new Uint8Array(readFileSync(process.argv[2]));
const report = await validator.validateBytes(bytes, { maxIssues: 0 });
console.log(JSON.stringify(report));
