#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ranges>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/dialects/tool_vectors.h"
#include "sim/program/block_motion.h"
#include "sim/program/canon.h"
#include "sim/program/nc_reader.h"

/// State and functions that the controls of all dialects share. The header of each dialect includes
/// this one, and with it everything that the sources of the dialects need.
namespace abbe::sim::dialects {

using kinematics::AxisVector;
using kinematics::Chain;
using program::ArcMove;
using program::Cause;
using program::Coordinates;
using program::Feed;
using program::FeedMode;
using program::Straight;
using program::Target;

/// The letters of all axes that a program may address.
inline constexpr std::string_view axis_letters = "XYZABCUVW";
/// Smallest feed per minute; keeps every duration finite.
inline constexpr double min_feed = 1e-9;

/// Returns the value of a key, or nothing if the map does not have it.
template <typename Map, typename Key>
std::optional<typename Map::mapped_type> find_value(const Map& map, const Key& key) {
  const auto entry = map.find(key);
  return entry == map.end() ? std::nullopt : std::optional(entry->second);
}

/// Returns the numbers of a table of tools, "H1 H2", for messages.
template <typename Entries>
std::string known_numbers(Entries&& entries, std::string_view letter) {
  std::string numbers;
  for (auto&& [number, value] : entries)
    numbers += fmt::format("{}{}{}", numbers.empty() ? "" : " ", letter, number);
  return numbers.empty() ? "none known" : numbers;
}

/// State of every control: the run of the program, and the canon that receives the moves.
class Control {
 protected:
  explicit Control(ProgramRun& run) : run_(run), canon_(run.canon) {}

  [[noreturn]] void throw_input_error(const Cause& cause, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    canon_.throw_input_error(cause, std::move(expected), std::move(seen));
  }
  /// Returns mm per programmed unit of length.
  double unit() const { return canon_.inch() ? units::inch : 1.0; }
  /// Returns the joint of the k-th letter of `axis_letters`, or -1 if the machine has none.
  int joint(int k) const { return canon_.joint_of(axis_letters[std::size_t(k)]); }

  ProgramRun& run_;
  program::Canon& canon_;
};

/// Replaces the feed of the program until the end of the scope, after an error too, so that later
/// blocks get the right time.
class TemporaryFeed {
 public:
  TemporaryFeed(program::Canon& canon, FeedMode mode, std::optional<Feed> feed)
      : canon_(canon), mode_(canon.feed_mode()), feed_(canon.feed()) {
    canon_.set_feed_mode(mode);
    canon_.set_feed(feed);
  }
  ~TemporaryFeed() {
    canon_.set_feed_mode(mode_);
    canon_.set_feed(feed_);
  }
  TemporaryFeed(const TemporaryFeed&) = delete;
  TemporaryFeed& operator=(const TemporaryFeed&) = delete;

 private:
  program::Canon& canon_;
  const FeedMode mode_;
  const std::optional<Feed> feed_;
};

/// Replaces the frame until the end of the scope, after an error too.
class TemporaryFrame {
 public:
  TemporaryFrame(program::Canon& canon, int system, program::Frame frame)
      : canon_(canon), system_(system), frame_(canon.frame()) {
    canon_.set_frame(system, std::move(frame));
  }
  ~TemporaryFrame() { canon_.set_frame(system_, std::move(frame_)); }
  TemporaryFrame(const TemporaryFrame&) = delete;
  TemporaryFrame& operator=(const TemporaryFrame&) = delete;

 private:
  program::Canon& canon_;
  const int system_;
  program::Frame frame_;
};

/// State of controls that are programmed in G codes: Fanuc, LinuxCNC and Siemens.
class GCodeControl : public Control {
 protected:
  explicit GCodeControl(ProgramRun& run) : Control(run), compensation_(run) {}

  /// Returns the letters of the plane in force, "XY" for G17.
  std::string_view plane_letters() const {
    return plane_ == 17 ? "XY" : plane_ == 18 ? "ZX" : "YZ";
  }
  /// Returns the index of the axis across the plane, 2 (Z) for G17.
  int plane_normal() const { return 19 - plane_; }
  /// Returns the joints of the plane. Throws BadInput if the machine lacks one.
  std::array<int, 2> plane_joints(const Cause& cause) const;

  /// Returns true while the axes are offset from the programmed path, and until the move after it.
  bool is_compensated() const { return compensation_.is_on() || compensation_.is_leaving(); }
  /// Returns the programmed position, from which compensation may offset the axes.
  AxisVector current_position() const {
    return is_compensated() ? compensation_.programmed() : canon_.position();
  }
  /// Same as `current_position` in program coordinates.
  AxisVector programmed_position() const { return canon_.without_offsets(current_position()); }

  /// Sets the feed mode. A change forgets F, which has another unit in the new mode.
  void change_feed_mode(FeedMode mode);
  /// Records that a block depends on the plane, if it is an arc, and on the feed mode, if it moves
  /// at feed. The names are those of the feed modes.
  void assume_plane_and_feed(bool is_arc, bool is_at_feed,
                             std::string_view per_minute = "F per minute (G94)",
                             std::string_view per_revolution = "F per revolution (G95)");
  /// Passes the surface speed in force to the canon, m/min, or ends it.
  void apply_surface_speed(double m_per_min);
  /// Dwells after a move that compensation still postpones.
  void dwell_after_move(double seconds, const Cause& cause);

  CutterCompensation compensation_;
  int plane_ = 17;  ///< number of the G code
  bool is_incremental_ = false, has_surface_speed_ = false;
  std::optional<double> max_rpm_;  ///< limit under constant surface speed
};

}  // namespace abbe::sim::dialects
