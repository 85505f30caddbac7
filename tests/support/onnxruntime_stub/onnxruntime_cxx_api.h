// The part of ONNX Runtime's C++ interface that examples/onnx/onnx_to_ply.cpp uses, with a network of 18 Gaussians that shows what it was given:
// means are the poses, intrinsics and bounds, colours the first 54 numbers of the images; the rest is made from the number of the Gaussian.
#pragma once
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

struct OrtAllocator {};
struct OrtMemoryInfo {};
enum OrtAllocatorType { OrtArenaAllocator };
enum OrtMemType { OrtMemTypeDefault };
enum OrtLoggingLevel { ORT_LOGGING_LEVEL_WARNING };

namespace Ort {
struct Env { Env(OrtLoggingLevel, const char*) {} };
struct SessionOptions {};
struct RunOptions { explicit RunOptions(std::nullptr_t) {} };
struct AllocatorWithDefaultOptions { operator OrtAllocator*() const { return nullptr; } };
struct MemoryInfo {
    static MemoryInfo CreateCpu(OrtAllocatorType, OrtMemType) { return {}; }
    operator const OrtMemoryInfo*() const { return nullptr; }
};
struct TensorTypeAndShapeInfo {
    std::vector<int64_t> shape;
    std::vector<int64_t> GetShape() const { return shape; }
};
struct TypeInfo {
    std::vector<int64_t> shape;
    TensorTypeAndShapeInfo GetTensorTypeAndShapeInfo() const { return {shape}; }
};
struct Value {
    std::vector<float> own;
    std::vector<int64_t> shape;
    Value(std::vector<float> numbers, std::vector<int64_t> sides) : own(std::move(numbers)), shape(std::move(sides)) {
        int64_t count = 1;
        for (int64_t side : shape) count *= side;
        if (count != int64_t(own.size())) throw std::runtime_error("a shape does not fit its numbers");
    }
    Value(Value&&) = default;  // as in the library, not copied
    template <typename T>
    static Value CreateTensor(const OrtMemoryInfo*, T* data, size_t count, const int64_t* sides, size_t axes) {
        return Value(std::vector<float>(data, data + count), std::vector<int64_t>(sides, sides + axes));
    }
    template <typename T>
    const T* GetTensorData() const { return own.data(); }
    TensorTypeAndShapeInfo GetTensorTypeAndShapeInfo() const { return {shape}; }
};
struct ModelMetadata {
    std::unique_ptr<char[]> LookupCustomMetadataMapAllocated(const char* key, OrtAllocator*) const {
        if (std::string(key) != "classes") return nullptr;
        const std::string text = "[\"wall\", \"shower curtain\"]";
        std::unique_ptr<char[]> copy(new char[text.size() + 1]);
        std::strcpy(copy.get(), text.c_str());
        return copy;
    }
};
struct Session {
    Session(const Env&, const char*, const SessionOptions&) {}
    TypeInfo GetInputTypeInfo(size_t) const { return {{2, 3, 4, 6}}; }
    ModelMetadata GetModelMetadata() const { return {}; }
    std::vector<Value> Run(const RunOptions&, const char* const* inputs, const Value* given, size_t, const char* const* outputs, size_t count) {
        std::vector<float> means, colours(given[0].own.begin(), given[0].own.begin() + 54);
        if (std::string(inputs[0]) != "images") throw std::runtime_error("expected images first");
        for (int k = 1; k < 4; ++k) means.insert(means.end(), given[k].own.begin(), given[k].own.end());
        std::vector<Value> found;
        for (size_t k = 0; k < count; ++k) {
            const std::string name = outputs[k];
            std::vector<float> made;
            int64_t columns = name == "opacities" ? 1 : name == "colour.scales" ? 3 : name == "colour.quaternions" ? 4 : 2;
            for (int64_t g = 0; g < 18; ++g)
                for (int64_t c = 0; c < columns; ++c)
                    made.push_back(columns == 1 ? (g + 1) / 20.0f : columns == 3 ? float(g + c + 1) : columns == 4 ? float(c == g % 4) : float(c == g % 2));
            if (name == "means") found.emplace_back(means, std::vector<int64_t>{18, 3});
            else if (name == "colour.features") found.emplace_back(colours, std::vector<int64_t>{18, 1, 3});
            else if (columns == 1) found.emplace_back(made, std::vector<int64_t>{18});
            else found.emplace_back(made, std::vector<int64_t>{18, columns});
        }
        return found;
    }
};
}  // namespace Ort
