#include "kinematics/bad_input.h"

#include <utility>

#include "kinematics/escape.h"

namespace abbe {
namespace {

std::string text(const std::string& file, int line, int column, const std::string& expected,
                 const std::string& seen) {
  std::string place = escaped(file);
  if (line > 0) place.append(":").append(std::to_string(line));
  if (line > 0 && column > 0) place.append(":").append(std::to_string(column));
  return place + ": expected " + escaped(expected) + ", seen " + escaped(seen);
}

}  // namespace

BadInput::BadInput(std::string file_, int line_, int column_, std::string expected_,
                   std::string seen_)
    : std::runtime_error(text(file_, line_, column_, expected_, seen_)),
      file(std::move(file_)),
      line(line_),
      column(column_),
      expected(std::move(expected_)),
      seen(std::move(seen_)) {}

}  // namespace abbe
