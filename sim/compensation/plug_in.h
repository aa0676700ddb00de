#pragma once

#include <filesystem>
#include <optional>

#include "sim/compensation/plug_in_protocol.h"

/// Anyone's own compensator: a program that speaks JSON lines, or a C function in a shared library.
/// The protocol is in sim/compensation/README.md.
namespace abbe::sim::compensation {

/// Asks a plug-in about a whole program: starts it, shakes hands, asks in batches in the order
/// given, ends it. A name that ends in .so is a shared library, anything else is run; a .py file
/// that is not executable or does not begin with #! is run by python3. A shared library runs in a
/// process of its own, so that its crash is not ours. Whatever happens, no process stays behind
/// that did not leave the group it was started in. Linux.
/// @throws PlugInFailure naming the plug-in, the step, what was expected and seen, and its last
///         words on stderr
PlugInResponse ask(const std::filesystem::path& plug_in, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// Asks a function of this process in the same batches, and holds its answers to the same rules.
/// @param name  what refusals call it
/// @throws PlugInFailure naming it, the batch, what was expected and seen; what the function throws
PlugInResponse ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// First line of a main whose program serves as PlugInOptions::host: does a host's whole work.
/// @return the exit code of a host; nothing in a program started by anybody else
std::optional<int> plug_in_host(int argc, char** argv);

}  // namespace abbe::sim::compensation
