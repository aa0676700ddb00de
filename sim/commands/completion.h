#pragma once

#include <string>
#include <vector>

#include "sim/commands/command.h"

/// Scripts by which shells complete a command line of abbe. They ask `abbe --cases` and
/// `abbe --keys` for the names of cases and keys.
namespace abbe::sim {

struct Question;

std::string bash_completion(const std::vector<Command>& commands,
                            const std::vector<Question>& questions);
std::string zsh_completion(const std::vector<Command>& commands,
                           const std::vector<Question>& questions);
std::string fish_completion(const std::vector<Command>& commands,
                            const std::vector<Question>& questions);

}  // namespace abbe::sim
