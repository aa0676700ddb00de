#include "sim/dialects/linuxcnc_commands.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects::linuxcnc {

using program::Feed;
using program::FeedMode;

namespace {

/// What moves nothing that abbe cuts.
constexpr std::string_view without_effect[] = {
    "SET_FEED_REFERENCE",
    "ON_RESET",
    "SET_MOTION_CONTROL_MODE",
    "SET_NAIVECAM_TOLERANCE",
    "SET_TRAVERSE_RATE",
    "START_CHANGE",
    "ENABLE_FEED_OVERRIDE",
    "DISABLE_FEED_OVERRIDE",
    "ENABLE_SPEED_OVERRIDE",
    "DISABLE_SPEED_OVERRIDE",
    "ENABLE_FEED_HOLD",
    "DISABLE_FEED_HOLD",
    "ENABLE_ADAPTIVE_FEED",
    "DISABLE_ADAPTIVE_FEED",
    "SET_MOTION_OUTPUT_BIT",
    "CLEAR_MOTION_OUTPUT_BIT",
    "SET_AUX_OUTPUT_BIT",
    "CLEAR_AUX_OUTPUT_BIT",
    "SET_AUX_OUTPUT_VALUE",
    "SET_MOTION_OUTPUT_VALUE",
    "ORIENT_SPINDLE",
    "PALLET_SHUTTLE",
    "MESSAGE",
    "LOG",
    "LOGOPEN",
    "LOGAPPEND",
    "LOGCLOSE",
    "INIT_CANON",
    "CLAMP_AXIS",
    "UNCLAMP_AXIS",
    "LOCK_ROTARY",
    "UNLOCK_ROTARY",
    "TURN_PROBE_ON",
    "TURN_PROBE_OFF",
    "UPDATE_TAG",
    "RELOAD_TOOLDATA",
};

bool is_without_effect(std::string_view name) {
  return std::find(std::begin(without_effect), std::end(without_effect), name) !=
             std::end(without_effect) ||
         name.find("WAIT_ORIENT_COMPLETE") != std::string_view::npos;
}

std::string_view between_quotes(std::string_view text) {
  const std::size_t open = text.find('"'), close = text.rfind('"');
  return open == close ? std::string_view() : text.substr(open + 1, close - open - 1);
}

}  // namespace

std::optional<PrintedCommand> printed_command(std::string_view line) {
  const auto skip = [&](std::string_view what) {
    line.remove_prefix(std::min(line.size(), line.find_first_not_of(what)));
  };
  skip(" ");
  const std::size_t before = line.size();
  skip("0123456789");
  if (line.size() == before || !line.starts_with(" N")) return std::nullopt;
  line.remove_prefix(2);
  PrintedCommand command;
  const auto [end, failure] =
      std::from_chars(line.data(), line.data() + line.size(), command.number);
  if (failure == std::errc()) line.remove_prefix(std::size_t(end - line.data()));
  skip(". ");
  const std::size_t open = line.find('('), close = line.rfind(')');
  if (open == std::string_view::npos || close == std::string_view::npos || close < open)
    return std::nullopt;
  command.name = line.substr(0, open);
  command.arguments = line.substr(open + 1, close - open - 1);
  return command;
}

Commands::Commands(ProgramRun& run, const NumberedProgram& program, const Eigen::Vector3d& zero)
    : run_(run), canon_(run.canon), program_(program), zero_(zero) {}

void Commands::refuse(std::string expected, std::optional<std::string> seen) const {
  canon_.refuse({0, program_.text_of(number_)}, std::move(expected), std::move(seen));
}

/// A command without a number, as those that M72 brings, stands where the last one did.
void Commands::stand(const PrintedCommand& command) {
  if (command.number <= 0 || command.number == number_) return;
  number_ = command.number;
  const SourceLine place = program_.place_of(number_);
  canon_.stand_at(place.line, place.file);
  codes_ = codes_of(program_.text_of(number_));
  at_point_ = 0;
}

bool Commands::take(std::string_view line) {
  if (ended_) return true;  // what it puts out behind the end of the program
  const auto command = printed_command(line);
  if (!command) return true;
  const bool changes = command->name == "START_CHANGE" || command->name == "STOP_SPINDLE_TURNING" ||
                       command->name == "CHANGE_TOOL";
  if (pending_ && (!changes || pending_in_ != command->number)) end_pending_tool();
  run_.attempt([&] {
    stand(*command);
    if (faulty_.count(number_) > 0) {  // the same again would be the same fault
      try {
        apply(*command);
      } catch (const Exhausted&) {
        throw;
      } catch (const BadInput&) {
        canon_.doubt_position();
      }
      return;
    }
    try {
      apply(*command);
    } catch (const BadInput&) {
      faulty_.insert(number_);
      throw;
    }
  });
  return !run_.hopeless();
}

void Commands::apply(const PrintedCommand& command) {
  run_.count_block();
  if (apply_state(command) || apply_motion(command) || apply_spindle(command) ||
      apply_tool(command) || apply_aside(command) || is_without_effect(command.name))
    return;
  refuse("a canonical command that abbe knows", in_quotes(command.name));
}

Commands::Numbers Commands::numbers(const PrintedCommand& command, std::size_t least) const {
  Numbers all;
  const std::string_view text = command.arguments;
  for (std::size_t at = 0; at < text.size();) {
    if (text[at] == ',' || text[at] == ' ') {
      ++at;
      continue;
    }
    double value = 0.0;
    const auto [end, failure] = std::from_chars(text.data() + at, text.data() + text.size(), value);
    if (failure != std::errc() || !std::isfinite(value))
      refuse("numbers in " + std::string(command.name), in_quotes(text));
    all.push_back(value);
    at = std::size_t(end - text.data());
  }
  if (all.size() < least)
    refuse(fmt::format("{} numbers in {}", least, command.name), in_quotes(text));
  return all;
}

Commands::Six Commands::six(const Numbers& numbers, std::size_t from) const {
  Six all;
  std::copy_n(numbers.begin() + std::ptrdiff_t(from), 6, all.begin());
  return all;
}

Commands::Six Commands::in_mm(Six lengths) const {
  for (std::size_t k = 0; k < 3; ++k) lengths[k] *= unit_;
  return lengths;
}

/// Program to axes, as LinuxCNC does it: turned about Z with G92 in it, then shifted.
void Commands::apply_frame() {
  program::Frame frame;
  frame.shift = AxisVector::Zero(canon_.position().size());
  Six first = g92_;
  if (turned_ != 0.0) {
    for (const std::size_t k : {0, 1, 2})
      if (joint(k) < 0) refuse("a machine with X Y Z for a coordinate system that is turned");
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(turned_, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Vector3d moved = R * Eigen::Vector3d(first[0], first[1], first[2]);
    for (int k = 0; k < 3; ++k) first[std::size_t(k)] = moved[k];
    frame.rotation = R;
  }
  for (std::size_t k = 0; k < 6; ++k) {
    const int j = joint(k);
    const double on_top = k < 3 ? zero_[Eigen::Index(k)] : 0.0;
    if (j >= 0)
      frame.shift[j] = (g5x_[k] - on_top + first[k]) * (canon_.is_linear(j) ? 1.0 : units::deg);
  }
  canon_.set_frame(system_ - 1, std::move(frame));
}

void Commands::set_units(bool inch) {
  if (number_ > 0 && inch != inch_ && canon_.feed() && codes_.feed)
    run_.warn_once(fmt::format(
        "{}:{}: F in a block that changes G20 and G21: LinuxCNC's own interpreter takes it in the "
        "unit before",
        canon_.place().file, canon_.line()));
  inch_ = inch;
  unit_ = inch ? units::inch : 1.0;
  canon_.set_inch(inch);
}

void Commands::check_length_unit(const char* word) const {
  const bool has = std::any_of(length_.begin(), length_.end(), [](double v) { return v != 0.0; });
  if (has && inch_ != length_in_inch_)
    refuse(
        fmt::format("no {} where G20 and G21 were switched under a tool length: rs274 takes "
                    "the length in the wrong unit there; G49 and G43 around the switch",
                    word),
        codes_.computed ? std::optional<std::string>("a code that is worked out") : std::nullopt);
}

bool Commands::apply_state(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "USE_LENGTH_UNITS") {
    set_units(command.arguments.find("INCHES") != std::string_view::npos);
  } else if (name == "SET_G5X_OFFSET") {
    const Numbers n = numbers(command, 7);
    system_ = int(std::clamp(n[0], 1.0, 9.0));
    g5x_ = in_mm(six(n, 1));
    apply_frame();
  } else if (name == "SET_G92_OFFSET") {
    // the first command that is sure to have zeros in it
    if (!digits_checked_ && command.arguments.find("0.0000") != std::string_view::npos)
      throw Exhausted("rs274", 0, 0, "numbers with all their digits", in_quotes(command.arguments));
    digits_checked_ = true;
    g92_ = in_mm(six(numbers(command, 6), 0));
    apply_frame();
  } else if (name == "SET_XY_ROTATION") {
    turned_ = numbers(command, 1)[0] * units::deg;
    apply_frame();
  } else if (name == "SELECT_PLANE") {
    const auto is = [&](const char* plane) {
      return command.arguments.find(plane) != std::string_view::npos;
    };
    if (is("_XY"))
      plane_ = {0, 1, 2};
    else if (is("_XZ"))
      plane_ = {2, 0, 1};
    else if (is("_YZ"))
      plane_ = {1, 2, 0};
    else
      refuse("a plane of X Y Z", in_quotes(command.arguments));
  } else if (name == "SET_FEED_MODE") {
    canon_.set_feed_mode(numbers(command, 2)[1] == 1 ? FeedMode::PerRevolution
                                                     : FeedMode::PerMinute);
  } else if (name == "SET_FEED_RATE") {
    const double rate = numbers(command, 1)[0];
    canon_.set_feed(rate > 0 ? std::optional(Feed{rate, unit_}) : std::nullopt);
  } else {
    return false;
  }
  return true;
}

/// Its own notes, which say when cutter compensation begins, and those of the program.
void Commands::comment(std::string_view text) {
  constexpr std::string_view own = "interpreter: ";
  if (!text.starts_with(own)) return canon_.comment(text);
  if (!text.starts_with("interpreter: cutter radius compensation on")) return;
  run_.warn_once(
      "under G41 and G42 LinuxCNC's own interpreter puts out a move when it reads the next: the "
      "lines of such moves may be those of the block behind");
  if (codes_.radius && codes_.d == -1 && tool_ <= 0)
    refuse("T and M6 before G41 and G42", "no tool called");
  const int tool = codes_.d >= 0 ? codes_.d : tool_;
  if (codes_.radius && codes_.d != not_literal && tool > 0 &&
      run_.options().control.tool_radius.count(tool) == 0 && stored_.count(tool) == 0)
    refuse("a tool whose radius is known", fmt::format("tool {}", tool));
}

bool Commands::apply_aside(const PrintedCommand& command) {
  const std::string_view name = command.name;
  if (name == "COMMENT")
    comment(between_quotes(command.arguments));
  else if (name == "MIST_ON")
    canon_.aside("M7");
  else if (name == "FLOOD_ON")
    canon_.aside("M8");
  else if (name == "FLOOD_OFF")  // M9 ends both, mist first
    canon_.aside("M9");
  else if (name == "MIST_OFF")
    return true;
  else if (name == "PROGRAM_STOP")
    canon_.aside("M0");
  else if (name == "OPTIONAL_PROGRAM_STOP")
    canon_.aside("M1");
  else if (name == "PROGRAM_END" || name == "FINISH")
    ended_ = true;
  else
    return false;
  return true;
}

}  // namespace abbe::sim::dialects::linuxcnc
