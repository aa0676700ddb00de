#pragma once

#include <sys/wait.h>
#include "tests/test.h"

/// The program run as a person runs it, and files for it.
namespace abbe::safety {

inline const fs::path source = ABBE_SOURCE_DIR;

struct Ran {
  int code = 0;
  std::string text;  ///< both streams
};

/// A line for the shell.
inline Ran shell(const std::string& command) {
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  Ran ran;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    ran.text.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  ran.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return ran;
}

/// @param before  words of the shell in front of the program
inline Ran run(const std::string& arguments, const std::string& before = "") {
  return shell(before + " " + ABBE_PROGRAM + " " + arguments);
}

inline std::string bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A folder of its own, gone afterwards.
class Folder {
 public:
  Folder()
      : path_(fs::temp_directory_path() /
              ("abbe-safety-" + std::to_string(std::random_device{}()))) {
    fs::create_directories(path_);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path write(const std::string& name, const std::string& text) const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }
  fs::path program(const std::string& name, const std::string& text) const {
    const fs::path file = write(name, text);
    fs::permissions(file, fs::perms::owner_all);
    return file;
  }
  fs::path operator/(const std::string& name) const { return path_ / name; }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// A plane of 4 x 4 mm that a short program cuts on the perfect gantry.
inline std::string small_scene(const std::string& more = "", const std::string& title = "plane") {
  const std::string scenes = (source / "scenes").string();
  return "title = \"" + title + "\"\nmachine = \"" + scenes +
         "/machines/gantry_cxyza.toml\"\ntool = \"" + scenes +
         "/tools/ball_r5.toml\"\n[part]\nsurface = \"rectangle\"\nlength_x_mm = 4\n"
         "length_y_mm = 4\nat_mm = [0, 0, 80]\nvertices = 200\n[program]\nfile = \"p.ngc\"\n" +
         more;
}
inline const std::string small_program =
    "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nG0 X-10 Y0 Z95 A0 C0\nG1 Z80 F1000\nG1 X10\nG0 "
    "Z95\nM2\n%\n";

}  // namespace abbe::safety
