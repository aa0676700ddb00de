#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "cutting/mesh_source.h"

namespace abbe::cutting {

/// The same text with A .. Z made small.
std::string lower(std::string_view text);

/// A word of a text file and where it stands, from 1.
struct Word {
  std::string_view text;  ///< empty at the end of the file
  int line = 1;
  int column = 1;
};

/// The words of a mesh file that is text, one after another; from `comment` (none if it is zero) to
/// the end of the line is passed over. Refusals name the place.
class Words {
 public:
  /// @param offset, line  where to begin, and the number of that line
  Words(const MeshSource& source, char comment, std::size_t offset = 0, int line = 1);

  /// The next word of the file.
  Word next();
  /// The next word of this line; empty at its end.
  Word next_in_line();
  /// From the next word of this line to its last, with the blanks between them.
  Word rest_of_line();
  void skip_line();
  bool at_end();
  std::size_t offset() const { return at_; }
  int line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - at_; }

  // All that follow throw BadInput where the word is another one.
  void expect(std::string_view keyword, const Word& seen) const;  ///< in small or large letters
  void expect(std::string_view keyword) { expect(keyword, next()); }
  double number(const Word& word) const;  ///< finite
  double number() { return number(next()); }
  Eigen::Vector3d point();  ///< the next three numbers
  std::int64_t integer(const Word& word, std::int64_t least, std::int64_t most,
                       const std::string& what) const;
  [[noreturn]] void refuse(const std::string& expected, const Word& seen) const;

 private:
  void skip(bool over_lines);
  Word take();

  const MeshSource& source_;
  std::string_view text_;
  std::size_t at_;
  std::size_t line_start_ = 0;
  int line_;
  char comment_;
};

}  // namespace abbe::cutting
