#include "sim/scene/trust.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <stdexcept>

#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_bytes = std::size_t(1) << 20;

/// Returns the risk that another user has written a file; empty if there is none.
std::string write_access_risk(const fs::path& file) {
  struct ::stat about {};
  if (::stat(file.c_str(), &about) != 0) return "one that cannot be looked at";
  // Root can write every file in any event.
  if (about.st_uid != ::geteuid() && about.st_uid != 0) return "one that belongs to somebody else";
  if ((about.st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return fmt::format("one that others can write (mode {:o})", about.st_mode & 07777u);
  return "";
}

fs::path resolved(const fs::path& file) {
  std::error_code failure;
  // Links are resolved, since a link in a trusted folder may lead outside of it.
  const fs::path real = fs::weakly_canonical(file, failure);
  return failure ? fs::absolute(file).lexically_normal() : real;
}

bool is_inside_folder(const fs::path& file, const std::vector<fs::path>& folders) {
  const fs::path real = resolved(file);
  return std::ranges::any_of(folders, [&](const fs::path& folder) {
    // Comparison by components, because /a/bc must not count as inside of /a/b.
    return std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first ==
           folder.end();
  });
}

std::optional<fs::path> folder_of(const char* variable) {
  const char* value = std::getenv(variable);
  // A relative path would depend on the current folder.
  if (value == nullptr || !fs::path(value).is_absolute()) return std::nullopt;
  return fs::path(value);
}

BadInput refusal(const NamedProgram& one) {
  const fs::path file = trust_file();
  return BadInput(one.file.string(), one.line, one.column,
                  "a program that you trust (--trust" +
                      (file.empty() ? std::string() : ", or its folder in " + file.string()) + ")",
                  "\"" + one.program.string() + "\", which has not been run");
}

}  // namespace

fs::path trust_file() {
  if (const auto folder = folder_of("XDG_CONFIG_HOME")) return *folder / "abbe" / "trust";
  if (const auto home = folder_of("HOME")) return *home / ".config" / "abbe" / "trust";
  return {};
}

std::vector<fs::path> trusted_folders(const fs::path& file) {
  std::error_code none;
  // The link itself counts as present, so that a dangling one is reported and not ignored.
  if (file.empty() || !fs::exists(fs::symlink_status(file, none))) return {};
  // Whoever can write the folder can replace the file in it.
  for (const fs::path& one : {file, file.parent_path()})
    if (const std::string seen = write_access_risk(one); !seen.empty())
      throw BadInput(one.string(), 0, 0,
                     "a trust file in a folder that you alone can write (chmod go-w)", seen);
  const std::string text = read_text(file, most_bytes);
  std::vector<fs::path> folders;
  Lines lines(text);
  while (auto line = lines.next()) {
    const std::size_t from = line->find_first_not_of(" \t");
    if (from == std::string_view::npos || (*line)[from] == '#') continue;
    const fs::path folder = line->substr(from, line->find_last_not_of(" \t") + 1 - from);
    if (!folder.is_absolute())
      throw BadInput(file.string(), lines.number(), 0, "the absolute path of a folder",
                     in_quotes(folder.string()));
    // without a trailing separator, as in "a/"
    const fs::path real = resolved(folder / ".");
    folders.push_back(real.has_filename() ? real : real.parent_path());
  }
  return folders;
}

std::vector<ProgramTrust> judged(const std::vector<NamedProgram>& programs,
                                 const Permissions& permissions) {
  std::optional<std::vector<fs::path>> folders;
  std::vector<ProgramTrust> all;
  for (const NamedProgram& one : programs) {
    bool trusted = permissions.trust || one.typed;
    if (!trusted) {
      // The trust file is read once, and only if a program depends on it.
      if (!folders) folders = trusted_folders(trust_file());
      // The scene that names the program must be trusted as well, as it chooses the program.
      trusted = is_inside_folder(one.file, *folders) && is_inside_folder(one.program, *folders);
    }
    all.push_back({one, trusted});
  }
  return all;
}

std::vector<fs::path> trusted_programs(const std::vector<NamedProgram>& programs,
                                       const Permissions& permissions) {
  std::vector<fs::path> trusted;
  std::vector<BadInput> refused;
  for (const ProgramTrust& one : judged(programs, permissions)) {
    if (one.trusted)
      trusted.push_back(one.named.program);
    else
      refused.push_back(refusal(one.named));
  }
  // All untrusted programs are reported together.
  if (!refused.empty()) throw BadScene(std::move(refused));
  return trusted;
}

Scene read_trusted_scene(const fs::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions) {
  Scene scene = read_scene(file, overrides);
  scene.trusted = trusted_programs(scene.programs, permissions);
  return scene;
}

void trust(Scene& scene, const CaseDescription& typed) {
  if (typed.plug_in.empty()) return;
  scene.trusted.push_back(typed.plug_in);
  // The program counts as a file of the scene, so that no result overwrites it.
  scene.files.push_back(typed.plug_in);
}

void trust(Scene& scene, const std::string& typed_case) {
  // A name with a dot or slash is the file of a plug-in.
  if (typed_case.find_first_of("./") != std::string::npos) trust(scene, plug_in_case(typed_case));
}

void check_trusted(const Scene& scene, const fs::path& program) {
  if (std::ranges::find(scene.trusted, program) != scene.trusted.end()) return;
  throw BadInput(scene.file.string(), 0, 0, "a program that you trust (--trust)",
                 "\"" + program.string() + "\", which has not been run");
}

Writer make_writer(const Scene& scene, const Permissions& permissions) {
  return {permissions, scene.files};
}

}  // namespace abbe::sim
