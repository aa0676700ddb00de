#pragma once

#include <string>

/// What the numbers of a description must be. Each refusal is a std::invalid_argument that begins
/// with `who`.
namespace abbe::errors {

[[noreturn]] void refuse(const std::string& who, const std::string& why);

void expect_positive(double value, const std::string& who, const char* what);
void expect_not_negative(double value, const std::string& who, const char* what);
void expect_finite(double value, const std::string& who, const char* what);
/// One of `nodes` nodes of a thermal network, from 0.
void expect_node(int node, int nodes, const std::string& who);

}  // namespace abbe::errors
