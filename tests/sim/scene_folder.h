#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "sim/scene/read_scene.h"

namespace abbe::sim {

/// A folder of its own for the files of one test, gone afterwards.
class SceneFolder {
 public:
  SceneFolder() {
    path_ = std::filesystem::temp_directory_path() /
            ("abbe_scene_" + std::to_string(std::random_device{}()));
    std::filesystem::create_directories(path_);
  }
  ~SceneFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  SceneFolder(const SceneFolder&) = delete;
  SceneFolder& operator=(const SceneFolder&) = delete;

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    const std::filesystem::path file = path_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// What is in a file; empty if there is none.
inline std::string bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Faults of a scene as one text; empty if it reads.
inline std::string faults_of(const std::filesystem::path& file,
                             const std::vector<Override>& overrides = {}) {
  try {
    read_scene(file, overrides);
    return {};
  } catch (const BadScene& fault) {
    return fault.what();
  }
}

}  // namespace abbe::sim
