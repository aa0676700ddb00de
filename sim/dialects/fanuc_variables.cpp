#include <cmath>

#include "kinematics/units.h"
#include "sim/dialects/fanuc_machine.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using program::FeedMode;

namespace {

/// Number of a variable within a range of `most`, from 0; -1 if it is beyond.
int within(int number, int first, int most) {
  return number >= first && number < first + most ? number - first : -1;
}

}  // namespace

void Machine::note_numbers(int sequence, int program) {
  if (sequence >= 0) sequence_ = sequence;
  program_ = program;
}

/// The joint of the k-th axis as the control counts them: X Y Z, then the others by letter.
int Machine::axis_of(int k) const {
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0 && k-- == 0) return j;
  return -1;
}

/// In program units: mm or inch, degrees.
double Machine::shown_value(int j, const AxisVector& q) const {
  if (j < 0 || q.size() == 0) return 0.0;
  if (diameters_ && j == joint(0)) return 2.0 * q[j] / unit();
  return canon_.is_linear(j) ? q[j] / unit() : q[j] / units::deg;
}

/// #4001 on: the G codes in force, by group.
std::optional<double> Machine::mode(int group) const {
  const FeedMode feed = canon_.feed_mode();
  switch (group) {
    case 1:
      return motion_ / 10;
    case 2:
      return plane_ / 10;
    case 3:
      return incremental_ ? 91 : 90;
    case 5:
      if (turning_) return feed == FeedMode::PerMinute ? 98 : 99;
      return feed == FeedMode::InverseTime ? 93 : feed == FeedMode::PerMinute ? 94 : 95;
    case 6:
      return canon_.inch() ? 20 : 21;
    case 7:
      return cutter_ / 10;
    case 8:
      return length_mode_ / 10.0;
    case 9:
      return cycle_code_ / 10;
    case 10:
      return to_r_ ? 99 : 98;
    case 13:
      return surface_speed_ ? 96 : 97;
    case 14:
      return system_ <= 6 ? 53.0 + system_ : 54.1;
    case 15:
      return 64;
    case 16:
      return !rotation_ ? 69.0 : tilted_ ? 68.2 : 68.0;
    case 17:
      return polar_.on ? 16 : 15;
    default:
      return std::nullopt;
  }
}

/// #4107 on: words in force.
std::optional<double> Machine::modal_word(int number) const {
  switch (number) {
    case 4107:
      return d_;
    case 4109:
      return canon_.feed() ? canon_.feed()->word : 0.0;
    case 4111:
      return h_;
    case 4113:
      return last_m_;
    case 4114:
      return sequence_;
    case 4115:
      return program_;
    case 4119:
      return speed_;
    case 4120:
      return std::max(selected_, 0);
    case 4130:
      return system_ > 6 ? system_ - 100 : 0;
    default:
      return std::nullopt;
  }
}

/// The tool offset that a variable holds: memory C.
Machine::OffsetVariable Machine::offset(int number) {
  if (turning_) return {};  // those of a turning control have other numbers
  const struct {
    int first, most;
    Offsets* of;
    bool wear;
  } ranges[] = {{2001, 200, &lengths_, true},  {2201, 200, &lengths_, false},
                {10001, 999, &lengths_, true}, {11001, 999, &lengths_, false},
                {12001, 999, &radii_, true},   {13001, 999, &radii_, false}};
  for (const auto& range : ranges)
    if (const int i = within(number, range.first, range.most); i >= 0)
      return {range.of, i + 1, range.wear};
  return {};
}

/// The coordinate system that a variable belongs to, and its axis.
AxisVector* Machine::origin(int number, int& k) {
  if (const int i = within(number, 5201, 140); i >= 0 && i % 20 < 9) {
    k = i % 20;
    return i / 20 == 0 ? &external_ : &systems_.try_emplace(i / 20, zero_).first->second;
  }
  if (const int i = within(number, 7001, 960); i >= 0 && i % 20 < 9) {
    k = i % 20;
    return &systems_.try_emplace(101 + i / 20, zero_).first->second;
  }
  return nullptr;
}

std::optional<double> Machine::variable(int number) {
  if (const OffsetVariable one = offset(number); one.of != nullptr) {
    const auto found = one.of->find(one.number);
    if (found == one.of->end()) return 0.0;
    return (one.wear ? found->second.wear : found->second.value.value_or(0.0)) / unit();
  }
  int k = 0;
  if (const AxisVector* of = origin(number, k)) return shown_value(axis_of(k), *of);
  if (const int group = within(number, 4001, 30); group >= 0) return mode(group + 1);
  if (const auto word = modal_word(number)) return word;
  const bool beside = compensation_.on() || compensation_.leaving();
  const AxisVector at = beside ? compensation_.programmed() : canon_.position();
  if (const int i = within(number, 5001, 9); i >= 0)
    return shown_value(axis_of(i), canon_.unplaced(at));
  if (const int i = within(number, 5041, 9); i >= 0) {
    AxisVector with_length = canon_.unplaced(canon_.position());
    if (canon_.tool_shift().size() > 0) with_length += canon_.tool_shift();
    return shown_value(axis_of(i), with_length);
  }
  if (const int i = within(number, 5021, 9); i >= 0) {
    const program::Coordinates now = canon_.coordinates();
    canon_.go_to(program::Coordinates::Axis, {1, {}});
    const double value = shown_value(axis_of(i), canon_.position());
    canon_.go_to(now, {1, {}});
    return value;
  }
  if (const int i = within(number, 5081, 9); i >= 0)
    return shown_value(axis_of(i), canon_.tool_shift());
  if (number == 3003 || number == 3004) return 0.0;
  return std::nullopt;
}

bool Machine::set_variable(int number, double value) {
  if (number == 3003 || number == 3004 || number == 3006) return true;
  if (const OffsetVariable one = offset(number); one.of != nullptr) {
    Geometry& geometry = (*one.of)[one.number];
    if (one.wear)
      geometry.wear = value * unit();
    else
      geometry.value = value * unit();
    return true;
  }
  int k = 0;
  AxisVector* of = origin(number, k);
  if (of == nullptr || axis_of(k) < 0 || rotation_ || compensation_.on()) return false;
  const int j = axis_of(k);
  const double scale = diameters_ && j == joint(0) ? 0.5 : 1.0;
  (*of)[j] = scale * value * (canon_.is_linear(j) ? unit() : units::deg);
  apply_frame();
  return true;
}

}  // namespace abbe::sim::dialects::fanuc
