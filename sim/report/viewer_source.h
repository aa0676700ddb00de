#pragma once

#include <string_view>

namespace abbe::sim {

/// Files of render/report, as they were when the program was built.
std::string_view viewer_page();
std::string_view viewer_style();
std::string_view viewer_unpack();
std::string_view viewer_script();
std::string_view charts_page();
std::string_view charts_style();
std::string_view charts_script();

}  // namespace abbe::sim
