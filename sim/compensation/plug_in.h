#pragma once

#include <filesystem>
#include <optional>

#include "sim/compensation/plug_in_protocol.h"

/// Plug-ins: a user's own compensator as a program that speaks JSON lines, or as a C function in a
/// shared library. The protocol is in sim/compensation/README.md.
namespace abbe::sim::compensation {

/// Runs a plug-in over a whole program: starts it, exchanges the handshake, asks in batches in the
/// given order, and ends it. A name that ends in .so is a shared library, anything else is run as a
/// program; a .py file that is not executable or does not begin with #! is run by python3. A shared
/// library runs in a process of its own, so that its crash does not end abbe. In every case no
/// process remains, unless it left the group it was started in. Linux only.
/// @throws PlugInFailure naming the plug-in, the step, what was expected and seen, and its last
///     lines on stderr
PlugInResponse ask(const std::filesystem::path& plug_in, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// Calls a function of this process in the same batches, with the same rules for its answers.
/// @param name  name in messages
/// @throws PlugInFailure naming it, the batch, what was expected and seen; whatever the function
///     throws
PlugInResponse ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                   const PlugInQuestion& question, const PlugInOptions& options = {});

/// Serves as a plug-in host; the first statement of a main whose program is `PlugInOptions::host`.
/// @return the exit code of a host; nothing in a program started in another way
std::optional<int> plug_in_host(int argc, char** argv);

}  // namespace abbe::sim::compensation
