#pragma once

#include <cstdint>
#include <span>

namespace abbe::cutting {

/// A run of material on a line, with the program lines that cut its ends: 0 skin of the blank,
/// negative where it was cut by a crash on that line.
struct DexelRun {
  double low = 0.0;  ///< mm along the line from the grid's origin
  double high = 0.0;
  std::int32_t low_line = 0;
  std::int32_t high_line = 0;
};

/// The runs of one line in rising order. A value of 32 bytes: one run needs no memory of its own.
class DexelLine {
 public:
  /// Differences below this are rounding, mm: nothing is cut off by less, no shorter run is kept.
  static constexpr double touch = 1e-9;

  DexelLine() : one_{} {}
  DexelLine(const DexelLine& other);
  DexelLine(DexelLine&& other) noexcept;
  DexelLine& operator=(DexelLine other) noexcept;
  ~DexelLine() { drop(); }

  std::span<const DexelRun> runs() const { return {data(), count_}; }
  bool empty() const { return count_ == 0; }

  /// mm of material.
  double length() const;
  /// mm of material between two places.
  double length(double low, double high) const;
  /// How far a place is inside material, along the line; negative outside, -infinity on an empty
  /// line.
  double inside_by(double at) const;

  /// Adds material beyond all there is; with what ends where it begins it becomes one run.
  void append(const DexelRun& run);
  /// Takes out what lies between two places (either may be infinite), which `line` then ends.
  /// @return mm of material taken
  double take(double low, double high, std::int32_t line);

 private:
  const DexelRun* data() const { return capacity_ == 0 ? &one_ : many_; }
  DexelRun* data() { return capacity_ == 0 ? &one_ : many_; }
  void drop();
  void insert(std::uint32_t place, const DexelRun& run);
  void erase(std::uint32_t place);

  std::uint32_t count_ = 0;
  std::uint32_t capacity_ = 0;  // 0: the one run lives here
  union {
    DexelRun one_;
    DexelRun* many_;
  };
};

}  // namespace abbe::cutting
