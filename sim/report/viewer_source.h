#pragma once

#include <string>
#include <string_view>

namespace abbe::sim {

/// Files of render/report, as they were when the program was built.
std::string_view viewer_page();
std::string_view viewer_style();
std::string_view charts_page();
std::string_view charts_style();

/// The scripts of a page, words.js first.
std::string viewer_script();
std::string charts_script();

}  // namespace abbe::sim
