#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/scene/scene.h"

/// Trust in programs. A program that a file names runs only if the user trusts it: with --trust, or
/// because the file and the program both lie in folders listed in the user's trust file. Programs
/// that the user types (--compensator, --case, --set) are trusted.
namespace abbe::sim {

/// Returns the user's trust file: $XDG_CONFIG_HOME/abbe/trust, else ~/.config/abbe/trust; empty if
/// neither variable names an absolute folder. Each line holds one absolute folder, and # begins a
/// comment.
std::filesystem::path trust_file();

/// Returns the folders of a trust file, with links resolved; none without such a file.
/// @throws BadInput if users other than its owner or root can write it or its folder, if it belongs
///         to another user, or if a line is no absolute path
std::vector<std::filesystem::path> trusted_folders(const std::filesystem::path& file);

/// A program that a file names, with the permission to run it.
struct ProgramTrust {
  NamedProgram named;
  bool trusted = false;
};
/// Returns the trust in each program.
/// @throws BadInput for the trust file, which is read only if needed
std::vector<ProgramTrust> judged(const std::vector<NamedProgram>& programs,
                                 const Permissions& permissions);

/// Returns the programs if all of them may run.
/// @throws BadScene with the position of every program that may not
std::vector<std::filesystem::path> trusted_programs(const std::vector<NamedProgram>& programs,
                                                    const Permissions& permissions);

/// Reads a scene as read_scene does and checks the trust in its programs. @throws BadScene also for
/// untrusted programs
Scene read_trusted_scene(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions);

/// Trusts a compensator that the user typed; does nothing for one that is no program.
void trust(Scene& scene, const CaseDescription& typed);
void trust(Scene& scene, const std::string& typed_case);

/// Checks a program immediately before its start. @throws BadInput unless the scene may run it
void check_trusted(const Scene& scene, const std::filesystem::path& program);

/// Returns the writer of the results of a scene, which never overwrites the files of the scene.
Writer make_writer(const Scene& scene, const Permissions& permissions);

}  // namespace abbe::sim
