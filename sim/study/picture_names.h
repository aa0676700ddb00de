#pragma once

#include <set>
#include <string>
#include <vector>

namespace abbe::sim::study {

/// Part of a file name on any system: letters, digits, "_" and "." of `text`, one "-" for whatever
/// else stands between them; at most 80 bytes, never empty, no "." first.
std::string file_part(const std::string& text);

/// Names of the files of one folder.
class PictureNames {
 public:
  /// The parts with "-" between them, and a number behind if the name is taken, in whatever case.
  std::string unused(const std::vector<std::string>& parts);

 private:
  std::set<std::string> taken_;
};

}  // namespace abbe::sim::study
