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

constexpr std::size_t max_trust_file_bytes = std::size_t(1) << 20;

/// Returns how another user could have written a file; empty if none could.
std::string write_access_risk(const fs::path& file) {
  struct ::stat status {};
  if (::stat(file.c_str(), &status) != 0) return "one that cannot be examined";
  // Files of root are accepted, as root can write every file anyway.
  if (status.st_uid != ::geteuid() && status.st_uid != 0) return "one that belongs to another user";
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return fmt::format("one that others can write to (mode {:o})", status.st_mode & 07777u);
  return "";
}

/// Resolves links, because a link in a trusted folder may lead out of it.
fs::path real_path(const fs::path& file) {
  std::error_code error_code;
  const fs::path real = fs::weakly_canonical(file, error_code);
  return error_code ? fs::absolute(file).lexically_normal() : real;
}

bool is_inside_folder(const fs::path& file, const std::vector<fs::path>& folders) {
  const fs::path real = real_path(file);
  return std::ranges::any_of(folders, [&](const fs::path& folder) {
    // Components are compared, because /a/bc is not inside /a/b.
    return std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first ==
           folder.end();
  });
}

/// Returns the absolute folder in an environment variable.
std::optional<fs::path> environment_folder(const char* variable) {
  const char* value = std::getenv(variable);
  // A relative path would depend on the current folder.
  if (value == nullptr || !fs::path(value).is_absolute()) return std::nullopt;
  return fs::path(value);
}

/// Returns the user's trust file: $XDG_CONFIG_HOME/abbe/trust, else ~/.config/abbe/trust; empty if
/// neither variable is an absolute path. Each line has one absolute folder; # begins a comment.
fs::path trust_file() {
  if (const auto folder = environment_folder("XDG_CONFIG_HOME")) return *folder / "abbe" / "trust";
  if (const auto home = environment_folder("HOME")) return *home / ".config" / "abbe" / "trust";
  return {};
}

BadInput untrusted_program_error(const ProgramReference& program) {
  const fs::path listing_file = trust_file();
  return BadInput(
      program.file.string(), program.line, program.column,
      "a program that you trust (--trust" +
          (listing_file.empty() ? std::string() : ", or its folder in " + listing_file.string()) +
          ")",
      "\"" + program.program.string() + "\", which has not been run");
}

}  // namespace

std::vector<fs::path> trusted_folders(const fs::path& file) {
  std::error_code error_code;
  // A dangling link counts as an existing file, so that it is reported and not ignored.
  if (file.empty() || !fs::exists(fs::symlink_status(file, error_code))) return {};
  // A user who can write the folder can replace the file.
  for (const fs::path& checked_path : {file, file.parent_path()})
    if (const std::string risk = write_access_risk(checked_path); !risk.empty())
      throw BadInput(checked_path.string(), 0, 0,
                     "a trust file in a folder that only you can write to (chmod go-w)", risk);
  const std::string text = read_text(file, max_trust_file_bytes);
  std::vector<fs::path> folders;
  LineReader lines(text);
  while (auto line = lines.next()) {
    const std::size_t begin = line->find_first_not_of(" \t");
    if (begin == std::string_view::npos || (*line)[begin] == '#') continue;
    const fs::path folder = line->substr(begin, line->find_last_not_of(" \t") + 1 - begin);
    if (!folder.is_absolute())
      throw BadInput(file.string(), lines.number(), 0, "the absolute path of a folder",
                     quoted_excerpt(folder.string()));
    // A trailing separator, as in "a/", would be a further component.
    const fs::path real = real_path(folder / ".");
    folders.push_back(real.has_filename() ? real : real.parent_path());
  }
  return folders;
}

std::vector<ProgramTrust> assess_trust(const std::vector<ProgramReference>& programs,
                                       const Permissions& permissions) {
  std::optional<std::vector<fs::path>> folders;
  std::vector<ProgramTrust> result;
  for (const ProgramReference& program : programs) {
    bool is_trusted = permissions.trust || program.from_command_line;
    if (!is_trusted) {
      if (!folders) folders = trusted_folders(trust_file());
      // The file that names the program must be trusted too, as it selects the program.
      is_trusted =
          is_inside_folder(program.file, *folders) && is_inside_folder(program.program, *folders);
    }
    result.push_back({program, is_trusted});
  }
  return result;
}

std::vector<fs::path> trusted_programs(const std::vector<ProgramReference>& programs,
                                       const Permissions& permissions) {
  std::vector<fs::path> trusted;
  std::vector<BadInput> input_errors;
  for (const ProgramTrust& trust : assess_trust(programs, permissions)) {
    if (trust.trusted)
      trusted.push_back(trust.reference.program);
    else
      input_errors.push_back(untrusted_program_error(trust.reference));
  }
  if (!input_errors.empty()) throw BadScene(std::move(input_errors));
  return trusted;
}

Scene read_trusted_scene(const fs::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions) {
  Scene scene = read_scene(file, overrides);
  scene.trusted = trusted_programs(scene.programs, permissions);
  return scene;
}

void trust(Scene& scene, const CaseDescription& compensator) {
  if (compensator.plug_in.empty()) return;
  scene.trusted.push_back(compensator.plug_in);
  // Results must not overwrite the program, so it becomes a file of the scene.
  scene.files.push_back(compensator.plug_in);
}

void trust(Scene& scene, const std::string& case_name) {
  // A name with a dot or slash denotes a plug-in file.
  if (case_name.find_first_of("./") != std::string::npos) trust(scene, plug_in_case(case_name));
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
