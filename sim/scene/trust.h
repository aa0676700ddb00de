#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/scene/scene.h"

/// A program that a file names runs only if the user trusts it: with --trust, or because the file
/// and the program both lie in folders that the user's trust file lists. What the user types (
/// --compensator, --case, --set) is trusted.
namespace abbe::sim {

/// The user's trust file: $XDG_CONFIG_HOME/abbe/trust, else ~/.config/abbe/trust; empty where
/// neither variable names an absolute folder. One absolute folder a line, # begins a comment.
std::filesystem::path trust_file();

/// The folders of a trust file, links resolved; none if there is no such file.
/// @throws BadInput if others than its owner or root can write it or its folder, if it is somebody
///         else's, or a line is no absolute path
std::vector<std::filesystem::path> trusted_folders(const std::filesystem::path& file);

/// A program that a file names, and whether it may run.
struct ProgramTrust {
  NamedProgram named;
  bool trusted = false;
};
/// @throws BadInput for the trust file, which is read only if it is needed
std::vector<ProgramTrust> judged(const std::vector<NamedProgram>& programs,
                                 const Permissions& permissions);

/// The programs, if all of them may run.
/// @throws BadScene with the place of every one that may not
std::vector<std::filesystem::path> trusted_programs(const std::vector<NamedProgram>& programs,
                                                    const Permissions& permissions);

/// As read_scene, with its programs trusted. @throws BadScene also where they are not
Scene read_trusted_scene(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Trusts a compensator that the user typed; nothing to do for one that is no program.
void trust(Scene& scene, const CaseDescription& typed);
void trust(Scene& scene, const std::string& typed_case);

/// The last door before a program starts. @throws BadInput unless the scene may run it
void check_trusted(const Scene& scene, const std::filesystem::path& program);

/// Who writes the results of a scene: its files are left alone.
Writer writer_of(const Scene& scene, const Permissions& permissions);

}  // namespace abbe::sim
