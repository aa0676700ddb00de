#pragma once

#include "sim/scene/read_scene.h"
#include "tests/test.h"

namespace abbe::sim {

/// A folder of its own for the files of one test, gone afterwards.
class SceneFolder {
 public:
  SceneFolder() {
    path_ = fs::temp_directory_path() / ("abbe_scene_" + std::to_string(std::random_device{}()));
    fs::create_directories(path_);
  }
  ~SceneFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  SceneFolder(const SceneFolder&) = delete;
  SceneFolder& operator=(const SceneFolder&) = delete;

  fs::path write(const std::string& name, const std::string& text) const {
    const fs::path file = path_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// What is in a file; empty if there is none.
inline std::string bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Faults of a scene as one text; empty if it reads.
inline std::string faults_of(const fs::path& file, const std::vector<Override>& overrides = {}) {
  try {
    read_scene(file, overrides);
    return {};
  } catch (const BadScene& fault) {
    return fault.what();
  }
}

}  // namespace abbe::sim
