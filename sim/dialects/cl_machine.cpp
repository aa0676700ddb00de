#include "sim/dialects/cl_machine.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim::dialects::cl {

using program::Feed;
using program::FeedMode;

namespace {

constexpr double smallest_feed = 1e-9;  // per minute; keeps every duration finite

/// The statement without what is not its meaning, to compare two of them.
std::string text_of(const Statement& s) {
  std::string text;
  for (const Item& item : s.items) text += std::string(item.text) + ",";
  return text;
}

}  // namespace

double Machine::unit() const { return inch_ ? units::inch : 1.0; }

double Machine::number(const Statement& s, std::size_t i, const char* what) const {
  if (i >= s.items.size())
    refuse(s.cause, fmt::format("{} behind {}", what, s.major), "too few values");
  if (!s.items[i].number) refuse(s.items[i], fmt::format("{}, a number within +-1e9", what));
  return *s.items[i].number;
}

Eigen::Vector3d Machine::vector(const Statement& s, std::size_t i, const char* what) const {
  return {number(s, i, what), number(s, i + 1, what), number(s, i + 2, what)};
}

int Machine::whole(const Item& item, int most, const char* what) const {
  const double value = item.number.value_or(-1.0);
  if (!(value >= 0 && value <= most) || value != std::floor(value))
    refuse(item, fmt::format("{}, a whole number of 0 to {}", what, most));
  return int(value);
}

/// A minor word that the statement has not.
void Machine::unknown(const Statement& s, const Item& item, const std::string& expected) {
  const std::string word = s.major + "/" + std::string(item.text);
  if (item.line != canon_.line()) canon_.stand_at(item.line);
  run_.unknown({item.column, word}, expected);
  canon_.stand_at(s.line);
}

void Machine::execute(Statement& s) {
  canon_.stand_at(s.line);
  if (s.in_comment && s.major != "CUTTER") return;
  if (s.major.empty()) refuse(s.cause, "a word at the beginning of the statement");
  const Fact* fact = fact_of(s.major);
  if (fact == nullptr) {
    const auto& first = s.pieces.front();
    if (first.text.find('=', first.from) != std::string_view::npos)
      refuse(s.cause, "posted statements: an APT source with definitions is processed first",
             "a definition");
    run_.unknown(s.cause, "a word of cutter locations");
    return;
  }
  if (fact->use == Use::Refused) refuse(s.cause, std::string(fact->sentence));
  if (fact->does == nullptr) return;
  read_items(s, canon_);
  (this->*fact->does)(s);
}

void Machine::fini(const Statement&) { ended_ = true; }

void Machine::units(const Statement& s) {
  if (s.items.size() != 1) refuse(s.cause, "MM or INCHES behind UNITS/");
  const Item& item = s.items.front();
  if (item.is("INCHES") || item.is("INCH") || item.is("IN"))
    inch_ = true;
  else if (item.is("MM"))
    inch_ = false;
  else
    refuse(item, "MM or INCHES");
  units_stated_ = true;
  canon_.set_inch(inch_);
}

void Machine::multax(const Statement& s) {
  if (s.items.empty() || s.items.front().is("ON")) {
    upright_ = false;
  } else if (s.items.front().is("OFF")) {
    upright_ = true;
    direction_ = Eigen::Vector3d::UnitZ();
  } else {
    refuse(s.items.front(), "ON or OFF");
  }
}

void Machine::rapid(const Statement& s) {
  for (const Item& item : s.items) refuse(item, "nothing behind RAPID");
  rapid_ = true;
}

/// FEDRAT/250,MMPM and FEDRAT/MMPM,250.
void Machine::feedrate(const Statement& s) {
  std::optional<double> value;
  FeedMode mode = FeedMode::PerMinute;
  double mm = unit();
  for (const Item& item : s.items) {
    if (item.number) {
      if (value) refuse(item, "one feed");
      if (!(*item.number >= smallest_feed)) refuse(item, "a feed above zero");
      value = item.number;
    } else if (item.is("MMPM") || item.is("MMPR")) {
      mm = 1.0;
      if (item.is("MMPR")) mode = FeedMode::PerRevolution;
    } else if (item.is("IPM") || item.is("IPR")) {
      mm = units::inch;
      inches_seen_ = true;
      if (item.is("IPR")) mode = FeedMode::PerRevolution;
    } else if (item.is("PERREV")) {
      mode = FeedMode::PerRevolution;
    } else if (item.is("INVERS")) {
      mode = FeedMode::InverseTime;
    } else if (!item.is("PERMIN")) {
      unknown(s, item, "MMPM, MMPR, IPM, IPR, PERMIN, PERREV or INVERS");
    }
  }
  if (!value) refuse(s.cause, "a feed behind FEDRAT/", "none");
  canon_.set_feed_mode(mode);
  canon_.set_feed(Feed{*value, mm});
}

/// Seconds, or turns of the spindle.
void Machine::delay(const Statement& s) {
  double seconds = number(s, 0, "the seconds of a dwell");
  if (s.items.size() > 1) {
    if (!s.items[1].is("REV")) return unknown(s, s.items[1], "REV, or nothing for seconds");
    if (canon_.spindle_direction() == 0 || !(canon_.spindle_speed() > 0))
      refuse(s.items[1], "a spindle that turns beside REV", "one that stands");
    seconds *= 60.0 / canon_.spindle_speed();
  }
  canon_.dwell(seconds, s.items.front().cause());
}

void Machine::stop(const Statement& s) { canon_.aside(s.major == "STOP" ? "M0" : "M1"); }

/// Points count from the system that the program was made in; of a second one nothing says where
/// the first is to it.
void Machine::msys(const Statement& s) {
  const std::string text = text_of(s);
  if (system_ && *system_ != text)
    refuse(s.cause, "one MSYS for the whole program: nothing says how the part lies in a second");
  system_ = text;
}

void Machine::origin(const Statement& s) {
  for (const Item& item : s.items)
    if (item.number.value_or(1.0) != 0.0)
      refuse(item, "0,0,0: a work offset says where the points count from");
}

/// Words whose OFF asks for nothing.
void Machine::only_off(const Statement& s) {
  if (s.items.size() == 1 && s.items.front().is("OFF")) return;
  refuse(s.cause, s.major == "CUTCOM"
                      ? "CUTCOM/OFF, the points being those of the tip: paths that a control "
                        "shifts by a radius are not read"
                      : s.major + "/OFF, as nothing may be left out");
}

void Machine::auxiliary(const Statement& s) {
  run_.warn_once(
      fmt::format("AUXFUN/ (line {}) is an M code of the control: it does nothing here", s.line));
}

void Machine::finish() {
  if (!units_stated_ && canon_.blocks() > 0)
    run_.warn_once(inches_seen_ ? "the program states no UNITS/, and IPM or IPR as its feed: its "
                                  "points are taken as mm all the same"
                                : "the program states no UNITS/: its points are taken as mm");
  vector_lines_.finish();
  if (bulge_.angle > least_bulge)
    run_.warn_once(fmt::format(
        "between two points the tool axis leaves the great circle of their vectors by up to {:.3g} "
        "deg (line {}), as the rotary axes turn in proportion: nearer points make it less",
        bulge_.angle / units::deg, bulge_.line));
}

}  // namespace abbe::sim::dialects::cl
