#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// Input errors, and escaping of external text for terminals, tables and JSON files.
namespace abbe {

/// Returns the text on one line that is safe to print on any terminal. Letters of UTF-8 are kept.
/// Control characters below U+0020 and bytes that are not UTF-8 become \x1b; DEL, the controls
/// U+0080 to U+009F, line and paragraph separators, bidirectional marks and other invisible format
/// characters become \u202e, as in JSON. Escaping is idempotent.
std::string escaped(std::string_view text);

/// Returns the escaped text with its line ends and tabs kept.
std::string escape_keeping_lines(std::string_view text);

/// Throws std::invalid_argument with this message unless `holds` is true.
inline void require(bool holds, const char* message) {
  if (!holds) throw std::invalid_argument(message);
}
inline void require(bool holds, const std::string& message) { require(holds, message.c_str()); }

/// Input error: location, what was expected and what was seen. `what()` reads "file:line:column:
/// expected ..., seen ..." on one line, with external text escaped; the members hold the text
/// unescaped. Lines and columns count from 1; 0 means unknown and is omitted.
struct BadInput : std::runtime_error {
  BadInput(std::string file, int line, int column, std::string expected, std::string seen);

  std::string file;
  int line;
  int column;
  std::string expected;
  std::string seen;
};

/// The input errors of one source in the order in which they were added. Duplicates are dropped;
/// after 200 errors a last entry says that more are not listed.
class InputErrorList {
 public:
  static constexpr std::size_t max_errors = 200;

  void add(const BadInput& error);
  const std::vector<BadInput>& list() const { return list_; }
  bool empty() const { return list_.empty(); }
  bool full() const { return list_.size() > max_errors; }

 private:
  std::vector<BadInput> list_;
};

}  // namespace abbe
