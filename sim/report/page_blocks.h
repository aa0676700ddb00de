#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

/// Blocks of a page as render/report/charts.js draws them. A word is a text, { label: key }, or a
/// list of both; a figure is a number, null, or { value, low, high }, its band of 95 %.
namespace abbe::sim {

using PageWord = nlohmann::ordered_json;

PageWord label_word(const std::string& key);
/// One after another. @param words  texts and labels
PageWord phrase(const std::vector<PageWord>& words);

/// The figure itself.
/// @throws std::invalid_argument if it is none
const nlohmann::ordered_json& figure_in(const nlohmann::ordered_json& json);

/// What every block has. @param group  of which one at a time is shown; empty: always
nlohmann::ordered_json page_block(const std::string& type, const std::string& id,
                                  const PageWord& title, const std::string& group = {});

struct PageColumn {
  PageWord head;
  std::string unit;
};
/// @param rows  array of arrays of words and figures
nlohmann::ordered_json table_block(const std::string& id, const PageWord& title,
                                   const std::vector<PageColumn>& columns,
                                   const nlohmann::ordered_json& rows,
                                   const std::string& group = {});

/// PNG files of a folder, called by their paths in it, one of which is shown at a time; null where
/// there are none.
/// @throws BadInput for one that cannot be read
nlohmann::ordered_json pictures_block(const std::string& id, const PageWord& title,
                                      const std::filesystem::path& folder,
                                      const std::vector<std::filesystem::path>& files);

/// Of so many readings those that a panel draws: one in `every`, `most` at most.
struct ReadingsDrawn {
  Eigen::Index every = 1;
  PageWord title;  ///< of the panel, with ", readings 1000 / 3000" where not all are drawn
};
ReadingsDrawn readings_drawn(const std::string& title, Eigen::Index count, Eigen::Index most);

/// A line or points of a panel. @param mark  "line", "points" or "both"
nlohmann::ordered_json series_of(const PageWord& name, const nlohmann::ordered_json& x,
                                 const nlohmann::ordered_json& y, const std::string& mark);

}  // namespace abbe::sim
