#include "sim/commands/explain_command.h"

#include <memory>
#include <set>

#include <fmt/format.h>

#include "sim/commands/all_keys.h"
#include "sim/files/terminal.h"
#include "sim/report/key_rows.h"

namespace abbe::sim {
namespace {

/// @throws BadUsage with the nearest key
Exit print_explanation(const std::string& question) {
  const std::vector<Key> keys = all_keys();
  const std::vector<KeyRow> rows = explained(keys, question);
  if (rows.empty()) {
    std::set<std::string> known;
    const bool dotted = question.find('.') != std::string::npos;
    for (const KeyRow& row : key_rows(keys))
      known.insert(dotted ? row.path : row.path.substr(row.path.rfind('.') + 1));
    const auto meant = nearest(question, known);
    throw BadUsage("KEY", fmt::format("expected a key of a scene or study{}, seen {}",
                                      meant ? " (nearest: " + *meant + ")" : "", question));
  }
  print("{}", Lines(to_text(rows)));
  return Exit::Ok;
}

}  // namespace

Command explain_command() {
  const auto key = std::make_shared<std::string>();
  return {"explain",
          "Say what a key of a scene or study is: unit, range, default",
          {"abbe explain part.radius_mm", "abbe explain study.monte_carlo"},
          {{"KEY", key.get(),
            "part.radius_mm, a section such as view, study.monte_carlo, or radius_mm"}},
          [key] { return print_explanation(*key); }};
}

}  // namespace abbe::sim
