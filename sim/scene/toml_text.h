#pragma once

#include <string>

#include "sim/scene/toml_tree.h"

/// TOML text of a tree, and how its values read in messages.
namespace abbe::sim {

/// TOML text of a table: plain values first, then sections; numbers as short as reads back the same
/// bits. parse_toml(to_toml(x)) has the values of x.
std::string to_toml(const Node& table);

/// One value as it stands right of "=", tables inline.
std::string to_toml_value(const Node& node);
/// A text as TOML has it: between quotes on one line, whatever is in it.
std::string to_toml_value(const std::string& text);
/// A number, as short as reads back the same bits.
std::string to_toml_value(double number);

/// How a value reads in a message: short, strings quoted.
std::string shown(const Node& node);

}  // namespace abbe::sim
