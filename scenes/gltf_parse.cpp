// The one place where tinygltf's code is compiled.
#include <fstream>  // tinygltf forgets it under TINYGLTF_NO_FS
#include <limits>

#define TINYGLTF_IMPLEMENTATION
#include "scenes/gltf_document.h"

namespace ivis {

Result<tinygltf::Model> parse_gltf_json(const std::string& json) {
  if (json.size() > std::numeric_limits<unsigned>::max())
    return input_error("JSON of " + std::to_string(json.size()) +
                       " bytes, at most 4 GiB are taken");
  tinygltf::TinyGLTF loader;
  tinygltf::Model model;
  std::string errors, warnings;
  bool good = false;
  try {
    good = loader.LoadASCIIFromString(&model, &errors, &warnings, json.data(),
                                      static_cast<unsigned>(json.size()), "",
                                      tinygltf::REQUIRE_VERSION);
  } catch (const std::exception& e) {
    errors = e.what();
  }
  // It also returns true when it left a primitive out; the text tells.
  if (!good || !errors.empty()) {
    while (!errors.empty() && errors.back() == '\n')
      errors.pop_back();
    return input_error("JSON: " +
                       (errors.empty() ? "cannot be read as glTF" : errors.substr(0, 400)));
  }
  return model;
}

}  // namespace ivis
