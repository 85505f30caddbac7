// In a page with the PlayCanvas engine: draws a .glb (in base64) from a pose (camera to world, OpenGL axes, column by column).
async ([glb, pose, fov, background]) => {
    document.body.style.margin = 0;
    const canvas = document.body.appendChild(document.createElement('canvas'));
    const app = new pc.Application(canvas, { graphicsDeviceOptions: { antialias: false } });
    app.setCanvasFillMode(pc.FILLMODE_FILL_WINDOW);
    app.setCanvasResolution(pc.RESOLUTION_AUTO);
    app.start();

    const camera = new pc.Entity();
    camera.addComponent('camera', {
        fov, nearClip: 0.01, farClip: 100, toneMapping: pc.TONEMAP_NONE,
        clearColor: new pc.Color(background, background, background)
    });
    const matrix = new pc.Mat4();
    matrix.data.set(pose);
    camera.setPosition(matrix.getTranslation());
    camera.setRotation(new pc.Quat().setFromMat4(matrix));
    app.root.addChild(camera);

    const asset = new pc.Asset('scene', 'container', { url: `data:model/gltf-binary;base64,${glb}`, filename: 'scene.glb' });
    app.assets.add(asset);
    await new Promise((resolve, reject) => {
        asset.ready(resolve);
        asset.once('error', reject);
        app.assets.load(asset);
    });
    app.root.addChild(asset.resource.instantiateRenderEntity());
    const sorted = (camera, layer, ready, loading) => ready && loading === 0;
    await new Promise(resolve => app.systems.gsplat.on('frame:ready', (...state) => sorted(...state) && resolve()));
    for (let frame = 0; frame < 3; frame++) {
        await new Promise(resolve => app.once('frameend', resolve));
    }
    return asset.resource.gsplats.length;
}
