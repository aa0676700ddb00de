#pragma once

#include <filesystem>
#include <optional>

#include "sim/compensation/plug_in_protocol.h"

/// Plug-ins: a compensator of the user as a program that exchanges JSON lines, or as a C function
/// in a shared library. sim/compensation/README.md describes the protocol.
namespace abbe::sim::compensation {

/// Runs a plug-in over a whole program: starts it, exchanges the handshake, asks in batches in the
/// given order, and ends it. A file whose name ends in .so is a shared library; any other file is
/// run as a program; a .py file that is not executable or does not begin with #! is run by python3.
/// A shared library runs in a separate process, so that its crash does not end abbe. No process
/// remains, unless it left its process group. Linux only.
/// @throws PlugInFailure naming the plug-in, the step, the expected and the seen text, and its last
///     lines on stderr
PlugInResponse ask(const std::filesystem::path& plug_in, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// Calls a function of this process in the same batches, with the same requirements on its answers.
/// @param name  name of the function in messages
/// @throws PlugInFailure naming the function, the batch, the expected and the seen text; passes on
///     exceptions of the function
PlugInResponse ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// Serves as a plug-in host. Must be the first call in the main of a program that is used as
/// `PlugInOptions::host`.
/// @return the exit code of a host; nothing if the program was not started as a host
std::optional<int> plug_in_host(int argc, char** argv);

}  // namespace abbe::sim::compensation
