#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

/// Blocks of a page as render/report/charts.js draws them. A word is a text, { label: key }, or a
/// list of both; a figure is a number, null, or { value, low, high }, its band of 95 %.
namespace abbe::sim {

using PageText = nlohmann::ordered_json;

PageText label_text(const std::string& key);
/// One after another. @param words  texts and labels
PageText phrase(const std::vector<PageText>& words);

/// The figure itself.
/// @throws std::invalid_argument if it is none
const nlohmann::ordered_json& figure_in(const nlohmann::ordered_json& json);

/// What every block has. @param group  of which one at a time is shown; empty: always
nlohmann::ordered_json page_block(const std::string& type, const std::string& id,
                                  const PageText& title, const std::string& group = {});

struct PageColumn {
  PageText head;
  std::string unit;
};
/// @param rows  array of arrays of words and figures
nlohmann::ordered_json table_block(const std::string& id, const PageText& title,
                                   const std::vector<PageColumn>& columns,
                                   const nlohmann::ordered_json& rows,
                                   const std::string& group = {});

/// PNG files of a folder, called by their paths in it, one of which is shown at a time; null where
/// there are none.
/// @throws BadInput for one that cannot be read
nlohmann::ordered_json pictures_block(const std::string& id, const PageText& title,
                                      const std::filesystem::path& folder,
                                      const std::vector<std::filesystem::path>& files);

/// Of so many readings those that a panel draws: one in `every`, `most` at most.
struct ReadingSubset {
  Eigen::Index every = 1;
  PageText title;  ///< of the panel, with ", readings 1000 / 3000" where not all are drawn
};
ReadingSubset reading_subset(const std::string& title, Eigen::Index count, Eigen::Index most);

/// A line or points of a panel. @param mark  "line", "points" or "both"
nlohmann::ordered_json series_of(const PageText& name, const nlohmann::ordered_json& x,
                                 const nlohmann::ordered_json& y, const std::string& mark);

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
std::string closing_section(const FiguresPage& page);

/// One page that needs nothing besides itself (render/report/charts.js): its blocks, then what was
/// asked, warnings, versions and how to repeat it.
/// @throws std::invalid_argument naming the label that is in no table
std::string page_html(const FiguresPage& page);

}  // namespace abbe::sim
