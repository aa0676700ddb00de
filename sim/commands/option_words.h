#pragma once

#include <string>
#include <vector>

#include "sim/commands/command.h"

/// What pages of the manual and completions ask of an option.
namespace abbe::sim {

/// Every option of a command that has dashes, `--help` among them, in the order of `--help`.
std::vector<Option> dashed_options(const Command& command);

/// What a command takes by its place.
std::vector<Option> placed_options(const Command& command);

bool is_flag(const Option& option);
bool is_list(const Option& option);
bool may_be_left_out(const Option& option);

/// The words that its value may be; empty where they are not listed.
std::vector<std::string> words_of(const Option& option);

/// Its value as a page calls it: "FILE", "N", "KEY=VALUE", "x|y|radius"; empty for a flag.
std::string value_name(const Option& option);

/// What a shell offers for a value.
enum class Offer { Nothing, Words, Cases, Settings, Keys, Files };
Offer offer_for(const Option& option);

/// Whether `--set` of a command changes a study, not a scene.
bool sets_a_study(const Command& command);

}  // namespace abbe::sim
