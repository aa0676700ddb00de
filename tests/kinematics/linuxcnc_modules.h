#pragma once

#include <sys/wait.h>
#include "tests/oracles/linuxcnc_folder.h"
#include "tests/test.h"

/// LinuxCNC's own kinematics modules as an oracle, each run in a process of its own by
/// `hal_pins.c`.
namespace abbe::linuxcnc {

inline std::optional<fs::path> modules() {
  const auto folder = oracles::linuxcnc_folder();
  if (!folder) return std::nullopt;
  return *folder / "usr/lib/linuxcnc/modules";
}

/// "x y z a b c u v w", or the positions of joints, the rest zero; mm and degrees.
using Nine = std::array<double, 9>;

/// An input of a module.
struct Pin {
  std::string name;
  double value = 0.0;
};

/// One module with its inputs.
class KinematicsModule {
 public:
  /// @param kind  of its kinematics, where it has several
  KinematicsModule(std::string name, std::vector<Pin> pins, int kind)
      : name_(std::move(name)), pins_(std::move(pins)), kind_(kind) {
    std::string folder = (fs::temp_directory_path() / "abbe_hal_XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = folder;
    const std::string source = std::string(ABBE_SOURCE_DIR) + "/tests/kinematics/hal_pins.c";
    run("cc -O1 -rdynamic -o '" + (folder_ / "hal_pins").string() + "' '" + source + "' -ldl -lm");
  }
  ~KinematicsModule() { fs::remove_all(folder_); }
  KinematicsModule(const KinematicsModule&) = delete;
  KinematicsModule& operator=(const KinematicsModule&) = delete;

  /// Places of the tool for positions of joints; `inverse` the other way.
  std::vector<Nine> forward(const std::vector<Nine>& joints) const {
    return turned("forward", joints);
  }
  std::vector<Nine> inverse(const std::vector<Nine>& places) const {
    return turned("inverse", places);
  }

 private:
  void run(const std::string& command) const {
    const int status =
        std::system(("{ " + command + "; } 2>'" + (folder_ / "said").string() + "'").c_str());
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
    std::ifstream said(folder_ / "said");
    throw std::runtime_error(command + ": " +
                             std::string(std::istreambuf_iterator<char>(said), {}));
  }

  std::vector<Nine> turned(const char* word, const std::vector<Nine>& from) const {
    {
      std::ofstream in(folder_ / "in");
      in.precision(std::numeric_limits<double>::max_digits10);
      for (const Pin& pin : pins_) in << "pin " << pin.name << " " << pin.value << "\n";
      if (kind_ != 0) in << "switch " << kind_ << "\n";
      for (const Nine& one : from) {
        in << word;
        for (const double value : one) in << " " << value;
        in << "\n";
      }
    }
    run("cd '" + folder_.string() + "' && timeout 60 ./hal_pins '" +
        (*modules() / (name_ + ".so")).string() + "' <in >out");
    std::ifstream out(folder_ / "out");
    std::vector<Nine> to(from.size());
    std::string number;
    for (Nine& one : to)
      for (double& value : one) {
        if (!(out >> number)) throw std::runtime_error(name_ + ": too few numbers");
        value = std::strtod(number.c_str(), nullptr);
      }
    return to;
  }

  std::string name_;
  std::vector<Pin> pins_;
  int kind_;
  fs::path folder_;
};

}  // namespace abbe::linuxcnc
