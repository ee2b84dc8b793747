// Makes .glb files: a tree of nodes and one animation, in the file's own buffer.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace figurine::ports::tests {

struct GlbBuilder {
  nlohmann::json json = {{"asset", {{"version", "2.0"}}},
                         {"nodes", nlohmann::json::array()},
                         {"accessors", nlohmann::json::array()},
                         {"bufferViews", nlohmann::json::array()},
                         {"animations",
                          {{{"name", "made"},
                            {"channels", nlohmann::json::array()},
                            {"samplers", nlohmann::json::array()}}}}};
  std::string bin;

  // Returns the node's index. parent -1: a root.
  int node(const std::string& name, int parent,
           const nlohmann::json& transform = nlohmann::json::object()) {
    const int index = static_cast<int>(json["nodes"].size());
    json["nodes"].push_back(transform);
    json["nodes"].back()["name"] = name;
    if (parent >= 0) json["nodes"][static_cast<size_t>(parent)]["children"].push_back(index);
    return index;
  }

  template <class T>
  int accessor(const std::vector<T>& values, int component_type, const std::string& type,
               size_t width) {
    while (bin.size() % 4 != 0) bin += '\0';
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}});
    bin.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", component_type},
                                 {"count", values.size() / width},
                                 {"type", type}});
    if (component_type != 5126) json["accessors"].back()["normalized"] = true;
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  void channel(int node_index, const std::string& path, const std::string& interpolation, int input,
               int output) {
    nlohmann::json& animation = json["animations"][0];
    animation["channels"].push_back({{"sampler", animation["samplers"].size()},
                                     {"target", {{"node", node_index}, {"path", path}}}});
    animation["samplers"].push_back(
        {{"input", input}, {"output", output}, {"interpolation", interpolation}});
  }

  void track(int node_index, const std::string& path, const std::string& interpolation,
             const std::vector<float>& times, const std::vector<float>& values) {
    const size_t width = path == "rotation" ? 4 : 3;
    const int input = accessor(times, 5126, "SCALAR", 1);
    channel(node_index, path, interpolation, input,
            accessor(values, 5126, width == 4 ? "VEC4" : "VEC3", width));
  }

  static std::string word(uint32_t value) { return {reinterpret_cast<const char*>(&value), 4}; }

  static std::string file(std::string text, std::string binary) {
    while (text.size() % 4 != 0) text += ' ';
    while (binary.size() % 4 != 0) binary += '\0';
    const size_t size = 12 + 8 + text.size() + 8 + binary.size();
    return "glTF" + word(2) + word(static_cast<uint32_t>(size)) +
           word(static_cast<uint32_t>(text.size())) + "JSON" + text +
           word(static_cast<uint32_t>(binary.size())) + std::string("BIN\0", 4) + binary;
  }

  std::string file() const {
    nlohmann::json whole = json;
    if (!whole.contains("buffers")) whole["buffers"] = {{{"byteLength", bin.size()}}};
    return file(whole.dump(), bin);
  }
};

}  // namespace figurine::ports::tests
