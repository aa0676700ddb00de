#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace abbe::sim::dialects {

/// Variables of a program: those of the whole program, and on top of them those of the call that
/// runs. What is of a call and what of the program the dialect says when it sets one.
class Variables {
 public:
  enum class Of { Program, Call };

  explicit Variables(std::size_t most = 1'000'000) : most_(most), calls_(1) {}

  /// A call begins with no variables of its own; it ends with `leave`.
  void enter() { calls_.emplace_back(); }
  void leave();
  int depth() const { return int(calls_.size()) - 1; }

  std::optional<double> number(int number, Of of = Of::Program) const;
  std::optional<double> named(std::string_view name, Of of = Of::Program) const;
  /// @return false where there are too many, and then nothing is set
  [[nodiscard]] bool set(int number, double value, Of of = Of::Program);
  [[nodiscard]] bool set(std::string_view name, double value, Of of = Of::Program);
  void unset(int number, Of of = Of::Program);

 private:
  struct Table {
    std::unordered_map<int, double> numbers;
    std::map<std::string, double, std::less<>> names;
  };
  Table& table(Of of) { return of == Of::Program ? program_ : calls_.back(); }
  const Table& table(Of of) const { return of == Of::Program ? program_ : calls_.back(); }

  std::size_t most_, count_ = 0;
  Table program_;
  std::vector<Table> calls_;  ///< the last one runs; the first is of the main program
};

}  // namespace abbe::sim::dialects
