// From photos to a labelled splat with ONNX Runtime's C++ API alone (https://github.com/microsoft/onnxruntime/releases).
//
//     g++ -std=c++17 -O2 onnx_to_ply.cpp -I ORT/include -L ORT/lib -lonnxruntime -Wl,-rpath,ORT/lib -o onnx_to_ply
//     ./onnx_to_ply small.onnx cameras.txt room.ply
//
// cameras.txt is that of onnx_to_ply.py, with images as binary PPM (P6) of the network's size, so that no library for images is needed.
#include <onnxruntime_cxx_api.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>


// The path of the network is one of Linux and macOS; on Windows it would be wide characters.
using Floats = std::vector<float>;

void append_image(Floats& images, const std::string& path, int64_t height, int64_t width) {
    std::ifstream file(path, std::ios::binary);
    std::string kind;
    int64_t w = 0, h = 0, most = 0;
    file >> kind >> w >> h >> most;
    if (kind != "P6" || w != width || h != height || most != 255)
        throw std::runtime_error(path + ": expected a binary PPM of " + std::to_string(height) + "x" + std::to_string(width));
    file.get();  // one blank after the header
    std::vector<unsigned char> bytes(3 * h * w);
    file.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
    for (int channel = 0; channel < 3; ++channel)  // [row column 3] to [3 row column]
        for (int64_t pixel = 0; pixel < h * w; ++pixel) images.push_back(bytes[3 * pixel + channel] / 255.0f);
}

int main(int argc, char** argv) try {
    if (argc != 4) throw std::runtime_error("usage: onnx_to_ply NETWORK.onnx CAMERAS.txt OUT.ply");
    Ort::Env environment(ORT_LOGGING_LEVEL_WARNING, "onnx_to_ply");
    Ort::Session session(environment, argv[1], Ort::SessionOptions());
    Ort::AllocatorWithDefaultOptions allocator;
    const auto images_shape = session.GetInputTypeInfo(0).GetTensorTypeAndShapeInfo().GetShape();  // view 3 row column
    const int64_t views = images_shape[0], height = images_shape[2], width = images_shape[3];

    Floats images, poses, intrinsics, bounds;
    const std::string cameras = argv[2], folder = cameras.substr(0, cameras.find_last_of('/') + 1);
    std::ifstream lines(cameras);
    std::string name;
    float fx, fy, cx, cy, nearest, farthest, number;
    while (lines >> name >> fx >> fy >> cx >> cy >> nearest >> farthest) {
        append_image(images, folder + name, height, width);
        for (int k = 0; k < 12 && lines >> number; ++k) poses.push_back(number);
        for (float last : {0, 0, 0, 1}) poses.push_back(last);
        for (float entry : {fx, 0.0f, cx, 0.0f, fy, cy, 0.0f, 0.0f, 1.0f}) intrinsics.push_back(entry);
        bounds.insert(bounds.end(), {nearest, farthest});
    }
    if (int64_t(bounds.size()) != 2 * views || int64_t(poses.size()) != 16 * views)
        throw std::runtime_error(cameras + ": expected " + std::to_string(views) + " lines of a name and 18 numbers");

    const char* inputs[] = {"images", "world_from_camera", "intrinsics", "depth_range"};
    const char* outputs[] = {"means", "colour.features", "opacities", "colour.scales", "colour.quaternions", "semantic.features"};
    const std::vector<std::vector<int64_t>> shapes = {images_shape, {views, 4, 4}, {views, 3, 3}, {views, 2}};
    const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
    std::vector<Ort::Value> given;
    Floats* values[] = {&images, &poses, &intrinsics, &bounds};
    for (int k = 0; k < 4; ++k)
        given.push_back(Ort::Value::CreateTensor<float>(memory, values[k]->data(), values[k]->size(), shapes[k].data(), shapes[k].size()));
    const auto found = session.Run(Ort::RunOptions{nullptr}, inputs, given.data(), 4, outputs, 6);
    std::map<std::string, const float*> arrays;
    for (int k = 0; k < 6; ++k) arrays[outputs[k]] = found[k].GetTensorData<float>();
    const auto harmonics_shape = found[1].GetTensorTypeAndShapeInfo().GetShape();  // Gaussian k 3
    const int64_t count = harmonics_shape[0], terms = harmonics_shape[1];
    const int64_t classes = found[5].GetTensorTypeAndShapeInfo().GetShape()[1];

    std::ofstream file(argv[3], std::ios::binary);
    file << "ply\nformat binary_little_endian 1.0\ncomment classes "
         << session.GetModelMetadata().LookupCustomMetadataMapAllocated("classes", allocator).get() << "\nelement vertex " << count << "\n";
    std::ostringstream names("x y z nx ny nz f_dc_0 f_dc_1 f_dc_2", std::ios::ate);
    for (int k = 0; k < 45; ++k) names << " f_rest_" << k;  // 15 harmonics above the constant, of red, then green, then blue
    names << " opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    std::istringstream words(names.str());
    while (words >> name) file << "property float " << name << "\n";
    file << "property uchar label\nend_header\n";
    for (int64_t g = 0; g < count; ++g) {
        float row[62] = {};
        std::copy_n(arrays["means"] + 3 * g, 3, row);
        const float* harmonics = arrays["colour.features"] + 3 * terms * g;
        std::copy_n(harmonics, 3, row + 6);
        for (int64_t k = 1; k < terms; ++k)
            for (int channel = 0; channel < 3; ++channel) row[9 + 15 * channel + k - 1] = harmonics[3 * k + channel];
        const float opacity = std::clamp(arrays["opacities"][g], 1e-7f, 1 - 1e-7f);
        row[54] = std::log(opacity / (1 - opacity));
        for (int axis = 0; axis < 3; ++axis) row[55 + axis] = std::log(arrays["colour.scales"][3 * g + axis]);
        std::copy_n(arrays["colour.quaternions"] + 4 * g, 4, row + 58);
        const float* shares = arrays["semantic.features"] + classes * g;
        file.write(reinterpret_cast<const char*>(row), sizeof row);
        file.put(char(std::max_element(shares, shares + classes) - shares));
    }
    if (!file.flush()) throw std::runtime_error(std::string(argv[3]) + ": could not be written");
    std::cout << argv[3] << ": " << count << " Gaussians\n";
    return 0;
} catch (const std::exception& error) {
    std::cerr << "onnx_to_ply: " << error.what() << "\n";
    return 2;
}
