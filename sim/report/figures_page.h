#pragma once

#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace abbe::sim {

/// A file that can be taken from a page.
struct PageFile {
  std::string name;
  std::string text;
};

/// What a page of tables and charts shows.
struct FiguresPage {
  std::string title;
  nlohmann::ordered_json blocks = nlohmann::ordered_json::array();  ///< page_blocks.h
  std::vector<std::pair<std::string, std::string>> asked;           ///< label of the value, value
  std::vector<std::string> warnings;
  std::string command;          ///< that gives the results again
  std::vector<PageFile> files;  ///< that the command needs, and the figures whole
  std::string language = "en";  ///< "en" or "zh", in which it opens
};

/// What was asked, warnings, versions and how to repeat it, as they close a page.
std::string closing_words(const FiguresPage& page);

/// One page that needs nothing besides itself (render/report/charts.js): its blocks, then what was
/// asked, warnings, versions and how to repeat it.
/// @throws std::invalid_argument naming the label that is in no table
std::string html_of(const FiguresPage& page);

}  // namespace abbe::sim
