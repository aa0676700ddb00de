#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/scene/scene.h"

/// Trust in programs. A program that a file names runs only if the user trusts it: by --trust, or
/// because both the file and the program are in folders that the user's trust file lists. Programs
/// on the command line (--compensator, --case, --set) are trusted.
namespace abbe::sim {

/// Returns the folders of a trust file, with links resolved; none if there is no such file.
/// @throws BadInput if the file or its folder belongs to another user, or can be written by others
///         than its owner or root, or if a line is not an absolute path
std::vector<std::filesystem::path> trusted_folders(const std::filesystem::path& file);

/// A program that a file names, and whether it may run.
struct ProgramTrust {
  ProgramReference reference;
  bool trusted = false;
};
/// Returns the trust in each program. The trust file is read only if a program depends on it.
/// @throws BadInput if the trust file is invalid
std::vector<ProgramTrust> assess_trust(const std::vector<ProgramReference>& programs,
                                       const Permissions& permissions);

/// Returns the paths of the programs.
/// @throws BadScene with the position of every program that is not trusted
std::vector<std::filesystem::path> trusted_programs(const std::vector<ProgramReference>& programs,
                                                    const Permissions& permissions);

/// Reads a scene as read_scene() does and checks the trust in its programs.
/// @throws BadScene also for untrusted programs
Scene read_trusted_scene(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Adds a compensator from the command line to the trusted programs, if it is a program.
void trust(Scene& scene, const CaseDescription& compensator);
void trust(Scene& scene, const std::string& case_name);

/// Checks a program immediately before its start.
/// @throws BadInput if the scene may not run it
void check_trusted(const Scene& scene, const std::filesystem::path& program);

/// Returns the writer of the results of a scene, which never overwrites the files of the scene.
Writer make_writer(const Scene& scene, const Permissions& permissions);

}  // namespace abbe::sim
