#include "sim/scene/instruments.h"

#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/cases.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

Fields<SignalsDescription::Current> current_fields() {
  using Current = SignalsDescription::Current;
  const auto read_viscous_torque = [](TableReader& reader, Current& current) {
    // The unit table converts the Nm of the key but not its rpm.
    if (const auto torque = reader.maybe_number("viscous_torque_Nm_per_rpm", non_negative))
      current.viscous_torque = *torque / units::rpm;
  };
  Key viscous = make_key("viscous_torque_Nm_per_rpm", Key::Kind::Number,
                         "speed-dependent torque of the idle spindle");
  viscous.range = non_negative;
  viscous.fallback = "0";
  return Fields<Current>()
      .number(required_key("torque_Nm_per_A"), &Current::torque_per_current, positive,
              "torque constant of the spindle motor")
      .number("idle_torque_Nm", &Current::idle_torque, non_negative,
              "constant torque of the idle spindle")
      .custom_field({viscous}, read_viscous_torque,
                    [](const Current& current, Node::Table& table) {
                      put_value(table, "viscous_torque_Nm_per_rpm",
                                current.viscous_torque * units::rpm /
                                    unit_factor("viscous_torque_Nm_per_rpm"));
                    })
      .number("noise_A", &Current::noise_A, non_negative, "standard deviation of a reading")
      .number("bandwidth_Hz", &Current::bandwidth, non_negative,
              "bandwidth of the first-order filter; 0: no filter");
}

Fields<SignalsDescription::Dynamometer> dynamometer_fields() {
  using Dynamometer = SignalsDescription::Dynamometer;
  return Fields<Dynamometer>()
      .number("noise_N", &Dynamometer::noise, non_negative, "standard deviation of a reading")
      .number("resolution_N", &Dynamometer::resolution, non_negative,
              "resolution of a reading; 0: not rounded")
      .number("bandwidth_Hz", &Dynamometer::bandwidth, non_negative,
              "bandwidth of the first-order filter; 0: no filter");
}

}  // namespace

const Fields<SignalsDescription>& signals_fields() {
  using Signals = SignalsDescription;
  static const Fields<Signals> fields =
      Fields<Signals>()
          .number(KeyName("interval_s").with_fallback("as fine as 20 000 rows allow"),
                  &Signals::interval, non_negative,
                  "interval between rows of `signals.csv`; each row is the sample nearest to a "
                  "multiple of it")
          .number(KeyName("history_interval_s").with_fallback("0: no rows"),
                  &Signals::history_interval, non_negative,
                  "interval between rows of the thermal history, at most 20 000 additional rows, "
                  "with the axes at their positions at the start of the program")
          .number("encoder_resolution_um", &Signals::encoder_resolution, non_negative,
                  "resolution of the encoders of slides; 0: not rounded")
          .number("encoder_resolution_urad", &Signals::encoder_resolution_rad, non_negative,
                  "resolution of the encoders of rotary axes; 0: not rounded")
          .number("encoder_noise_um", &Signals::encoder_noise, non_negative,
                  "noise of the encoders of slides, standard deviation")
          .number("encoder_noise_urad", &Signals::encoder_noise_rad, non_negative,
                  "noise of the encoders of rotary axes, standard deviation")
          .table("current", &Signals::current, current_fields(), "current of the spindle motor")
          .table("dynamometer", &Signals::dynamometer, dynamometer_fields(),
                 "force between the part and the table");
  return fields;
}

namespace {

using namespace errors::identification;
using Method = SensorChoiceDescription::SelectionMethod;

/// An enum value of the key `likeness`.
struct SimilarityName {
  const char* word;
  SimilarityMeasure similarity_measure;
  GreyKind grey;
  const char* sentence;
};
constexpr std::array similarity_names{
    SimilarityName{"deng", SimilarityMeasure::Grey, GreyKind::Deng, "Deng's grey degree"},
    SimilarityName{"absolute", SimilarityMeasure::Grey, GreyKind::Absolute,
                   "Liu's grey degree of areas"},
    SimilarityName{"relative", SimilarityMeasure::Grey, GreyKind::Relative,
                   "Liu's degree, of series divided by their first values"},
    SimilarityName{"comprehensive", SimilarityMeasure::Grey, GreyKind::Comprehensive,
                   "the mean of \"absolute\" and \"relative\""},
    SimilarityName{"correlation", SimilarityMeasure::Correlation, GreyKind::Deng,
                   "absolute value of the correlation"},
};

Key similarity_key() {
  Key key = make_key(KeyName("likeness").with_fallback(similarity_names.front().word),
                     Key::Kind::Text, "measure of similarity between a sensor and the error");
  for (const SimilarityName& name : similarity_names)
    key.choices.push_back({name.word, name.sentence, {}});
  return key;
}

/// Returns the fields of a selection method, common to `[sensor_choice]` and the methods it is
/// compared with.
Fields<SensorChoiceOptions> selection_fields() {
  using Options = SensorChoiceOptions;
  const Key similarity_measure = similarity_key();
  return Fields<Options>()
      .integer("count", &Options::count, 1, 100,
               "number of sensors, one set for X, Y and Z together")
      .custom_field(
          {similarity_measure},
          [similarity_measure](TableReader& reader, Options& choice) {
            const auto word =
                reader.word(similarity_measure.name, choice_names(similarity_measure), false);
            for (const SimilarityName& name : similarity_names)
              if (word == name.word) {
                choice.similarity_measure = name.similarity_measure;
                choice.grey.kind = name.grey;
              }
          },
          [similarity_measure](const Options& choice, Node::Table& table) {
            for (const SimilarityName& name : similarity_names)
              if (choice.similarity_measure == name.similarity_measure &&
                  choice.grey.kind == name.grey)
                put_value(table, similarity_measure.name, std::string(name.word));
          })
      .choice(
          "image", [](auto& choice) -> auto& { return choice.grey.image; },
          {{"initial", Image::Initial, "x / x(1)"},
           {"mean", Image::Mean, "x / mean"},
           {"interval", Image::Interval, "(x - min) / (max - min)"}},
          "transformation of a series for Deng's degree")
      .choice("screening", &Options::screening,
              {{"degree", Screening::Degree, "the sensors most similar to the error"},
               {"regression", Screening::Regression,
                "one sensor after another, each chosen to reduce the residual most"}},
              "selection among the leaders of the groups")
      .number(KeyName("threshold")
                  .with_fallback("the highest value that gives at most `groups` groups"),
              &Options::threshold, {0.0, 1.0}, "sensors at least this similar form one group")
      .integer("groups", &Options::groups, 1, 1000,
               "largest number of groups, without a `threshold`");
}

std::vector<std::string> read_names(TableReader& reader, const std::string& key) {
  const Node* list = reader.accept_key(key);
  if (!list) return {};
  std::vector<std::string> names;
  for (const Node& node : list->array() ? *list->array() : Node::Array{})
    if (node.text() && !node.text()->empty())
      names.push_back(*node.text());
    else
      reader.input_errors().add(node.position, "a name", display_text(node));
  // An empty list stands for the default and must not be written by mistake.
  if (names.empty()) reader.report_invalid(key, "a list of names", display_text(*list));
  return names;
}

template <typename M>
void add_names(Fields<Method>& fields, const KeyName& name, M member, const char* sentence) {
  const Key key = make_key(name, Key::Kind::Texts, sentence);
  fields.custom_field(
      {key},
      [key, member](TableReader& reader, Method& method) {
        std::invoke(member, method) = read_names(reader, key.name);
      },
      [key, member](const Method& method, Node::Table& table) {
        Node::Array names;
        for (const std::string& name : std::invoke(member, method)) names.push_back(Node{{}, name});
        if (!names.empty()) put_value(table, key.name, std::move(names));
      });
}

Fields<Method> method_fields() {
  Fields<Method> fields;
  fields.text(required_key("name"), &Method::name, "name of this method");
  add_names(
      fields, "sensors", [](auto& method) -> auto& { return method.choice.fixed; },
      "names of sensors to use as given; no selection is made");
  add_names(fields, KeyName("for").with_fallback("all"), &Method::drifts,
            "displacements for which sensors are chosen: [\"Z\"]");
  return fields.custom_field(
      selection_fields().keys(),
      [](TableReader& reader, Method& method) {
        // With fixed sensors nothing is selected; the keys of the selection are then unknown.
        if (method.choice.fixed.empty())
          method.choice = selection_fields().read(reader, method.choice);
      },
      [](const Method& method, Node::Table& table) {
        if (!method.choice.fixed.empty()) return;
        append_entries(table, selection_fields().to_table(method.choice));
      });
}

void read_methods(TableReader& reader, SensorChoiceDescription& description) {
  std::set<std::string> names;
  for (const Node* node : reader.tables("beside")) {
    description.compared_methods.push_back(
        method_fields().read_table(*node, reader.qualified_name("beside"), reader.input_errors()));
    // Results are listed by the name of the method.
    const std::string& name = description.compared_methods.back().name;
    if (!name.empty() && !names.insert(name).second)
      reader.input_errors().add(node->position, "a name that no other method in beside has",
                                "\"" + name + "\" again");
  }
}

void put_methods(const SensorChoiceDescription& description, Node::Table& table) {
  Node::Array methods;
  for (const Method& method : description.compared_methods)
    methods.push_back(Node{{}, method_fields().to_table(method)});
  if (!methods.empty()) put_value(table, "beside", std::move(methods));
}

Key methods_key() {
  Key key = make_key("beside", Key::Kind::Tables,
                     "other selection methods, rated with the same model for comparison");
  key.keys = method_fields().keys();
  return key;
}

const Fields<SensorChoiceDescription>& sensor_choice_fields() {
  using Description = SensorChoiceDescription;
  static const Fields<Description> fields =
      Fields<Description>()
          .text("instrument", &Description::instrument, "name of the drift instrument")
          .include_fields(
              [](auto& description) -> auto& { return description.study.choice; },
              selection_fields())
          .choice(
              "model", [](auto& description) -> auto& { return description.study.model.kind; },
              {{"linear", ModelKind::Linear},
               {"ridge", ModelKind::Ridge},
               {"lasso", ModelKind::Lasso},
               {"support_vectors", ModelKind::SupportVectors},
               {"kernel_ridge", ModelKind::KernelRidge},
               {"network", ModelKind::Network}},
              "model of the drift as a function of the temperatures of the chosen sensors")
          .boolean(
              "since_start",
              [](auto& description) -> auto& { return description.study.features.since_start; },
              "true: temperatures are relative to the start of the day")
          .number(
              "lag_rows",
              [](auto& description) -> auto& { return description.study.features.lag_rows; },
              non_negative,
              "each temperature is also used with a lag of this many readings; 0: no lag")
          .integer(
              "random_subsets",
              [](auto& description) -> auto& { return description.study.random_subsets; }, 0, 10000,
              "random subsets of the same size as the choice, for comparison")
          .custom_field({methods_key()}, read_methods, put_methods);
  return fields;
}

}  // namespace

SensorChoiceDescription read_sensor_choice(const Node& table, InputErrors& input_errors) {
  return sensor_choice_fields().read_table(table, "sensor_choice", input_errors);
}
Node::Table sensor_choice_to_table(const SensorChoiceDescription& choice) {
  return sensor_choice_fields().to_table(choice);
}
std::vector<Key> sensor_choice_keys() { return sensor_choice_fields().keys(); }

namespace {

namespace metrology = errors::metrology;
using metrology::CoordinateMeasuringMachine;
using metrology::Instrument;
using metrology::Kind;
using metrology::TouchProbe;
using PartInstrument = PartInstrumentDescription;

constexpr Range quality{0.0, 1e4, false, false};  // um or urad; nothing is measured above
constexpr Range wait_s{0.0, 1e6};
constexpr Range speed{1e-3, 1e9, false, false};  // mm/min; below this no day is long enough

constexpr const char *cmm = "cmm", *touch_probe = "touch_probe";

bool is_part_instrument(const std::string& kind) { return kind == cmm || kind == touch_probe; }

/// Each kind of instrument, with the readings and the quality of a typical one.
constexpr std::array<std::pair<Kind, const char*>, 17> kinds{{
    {Kind::Laser,
     "interferometer, positioning of each slide in both directions (ISO 230-2); 0.05 µm, scale "
     "0.25 µm/m, beam within 200 µrad, 5 runs"},
    {Kind::Straightness,
     "straightness of each slide in both transverse directions; 0.3 µm, scale 0.25 %, mirror "
     "within 500 µrad, 3 runs"},
    {Kind::AngleOptics,
     "pitch and yaw of slides, position of rotary axes; 0.2 µrad, scale 0.1 %, 3 runs"},
    {Kind::Square,
     "two straightness lines against one artefact, for each pair of slides; 0.3 µm, aligned within "
     "500 µrad, 3 runs"},
    {Kind::Diagonals,
     "four body and six face diagonals (ISO 230-6); accuracy as for the laser, 5 runs"},
    {Kind::StepDiagonal,
     "four body diagonals in steps of X, Y, Z against a flat mirror (laser vector); accuracy as "
     "for the laser, 10 steps, one direction, 3 runs"},
    {Kind::BallBar,
     "circles and arcs in each plane (ISO 230-4); 0.25 µm, length within 20 µm/m, centre within 2 "
     "µm, 72 targets"},
    {Kind::BallBarRotary,
     "ball bar radial, tangential and axial to a rotary axis that turns while the slides follow "
     "(ISO 10791-6); accuracy as for the ball bar"},
    {Kind::RTest,
     "ball at the tool and three sensors on the table, while a rotary axis turns and the slides "
     "follow (ISO 10791-6); 0.3 µm, nest within 300 µrad, ball within 2 µm, 36 targets"},
    {Kind::Sphere,
     "touch probing of a sphere on the table in a grid of rotary positions; 0.5 µm, ball within 2 "
     "µm, 7 targets per axis"},
    {Kind::Tracker,
     "range and two angles to a reflector on a grid of the travel; 0.5 µm, 1.5 µrad, scale 0.5 "
     "µm/m, 5 targets per axis"},
    {Kind::Multilateration,
     "lengths alone from four stations; 0.1 µm, scale 0.15 µm/m, 5 targets per axis"},
    {Kind::Level,
     "tilt of each slide's carriage against gravity; 2 µrad, aligned within 5 mrad, 3 runs"},
    {Kind::RollLines,
     "straightness along two parallel lines: roll without a level; 0.2 µm, 500 µrad, 3 runs"},
    {Kind::Spindle,
     "five sensors around an artefact (ISO 230-7); 0.015 µm, ball off centre by 10 µm, 1000 rpm, "
     "64 readings per revolution, 20 revolutions, `lever_mm` 50"},
    {Kind::Drift,
     "three displacements and two tilts at one point over time (ISO 230-3); 0.02 µm, 0.5 µrad, "
     "nest within 1000 µrad"},
    {Kind::Temperature, "the machine's sensors alone, with their own accuracy"},
}};

KeyName typical_value(const char* key) { return KeyName(key).with_fallback("that of the kind"); }

void add_noise_fields(Fields<Instrument>& fields) {
  fields
      .number(typical_value("noise_um"), &Instrument::noise, quality,
              "standard deviation of one reading of a length")
      .number(typical_value("noise_urad"), &Instrument::noise_rad, quality,
              "standard deviation of one reading of an angle")
      .number(typical_value("resolution_um"), &Instrument::resolution, quality,
              "readings of lengths are multiples of it; 0: not rounded")
      .number(typical_value("resolution_urad"), &Instrument::resolution_rad, quality,
              "readings of angles are multiples of it; 0: not rounded")
      .number(typical_value("alignment_urad"), &Instrument::rotation_sigma, {0.0, 1e4},
              "standard deviation of the orientation of a beam, an artefact or a nest")
      .number(typical_value("position_um"), &Instrument::position_sigma, {0.0, 1e4},
              "standard deviation of the positions of reflectors, balls and stations")
      .number(
          typical_value("scale_um_per_m"), &Instrument::scale_sigma, {0.0, 1e4},
          "standard deviation of the wavelength, the material temperature or the length of a bar")
      .number("drift_um_per_h", &Instrument::drift_sigma, non_negative,
              "standard deviation of the instrument's drift since the first reading of a set-up");
}

void read_instrument_axes(TableReader& reader, Instrument& instrument) {
  const Node* list = reader.accept_key("axes");
  if (!list) return;
  // The list replaces the axes of the kind and does not add to them.
  instrument.axes.clear();
  if (!list->array())
    reader.report_invalid("axes", "a list of letters such as [\"X\", \"Y\"]", display_text(*list));
  for (const Node& letter : list->array() ? *list->array() : Node::Array{}) {
    if (letter.text() && letter.text()->size() == 1)
      instrument.axes.push_back(letter.text()->front());
    else
      reader.input_errors().add(letter.position, "the letter of an axis", display_text(letter));
  }
}

void put_axes(const Instrument& instrument, Node::Table& table) {
  Node::Array letters;
  for (const char axis : instrument.axes) letters.push_back(Node{{}, std::string(1, axis)});
  if (!letters.empty()) put_value(table, "axes", std::move(letters));
}

void add_targets(Fields<Instrument>& fields) {
  fields
      .custom_field(
          {make_key(KeyName("axes").with_fallback("all that apply"), Key::Kind::Texts,
                    "letters of axes; for planes and diagonals, those between these axes")},
          read_instrument_axes, put_axes)
      .integer(typical_value("runs"), &Instrument::runs, 1, 1000,
               "repetitions; for a spindle, revolutions")
      .integer(typical_value("targets"), &Instrument::targets, 2, 10000,
               "number of targets along an axis, a circle, a diagonal or a grid line; steps; "
               "readings per revolution. Full revolutions of a bar, an R-test or a sphere are read "
               "at this many different positions, without a repetition of the first at the end")
      .boolean(KeyName("both_ways")
                   .with_fallback("true; false for grids, spheres and the step diagonal"),
               &Instrument::bidirectional,
               "true: measures in both directions; circles also clockwise")
      .number("margin", &Instrument::margin, {0.0, 0.4, true, true},
              "fraction of the travel left free at both ends")
      .number(KeyName("scatter").with_fallback("0.3 for a laser, else 0"), &Instrument::scatter,
              {0.0, 0.45},
              "deviation of the targets between the first and the last from equal spacing, as a "
              "fraction of the spacing, so that no screw pitch is hidden between them; below 0.45")
      .direction("up", &Instrument::up_b,
                 "direction opposite to gravity in the bed frame: the plumb line of a level")
      .vector(KeyName("at_mm").with_fallback("within the travel"), &Instrument::location_w,
              "position in the workpiece frame: ball of an R-test, a rotary bar, a sphere or a "
              "drift test; centre of a circle; station of a tracker")
      .vector("reflector_mm", &Instrument::reflector_t,
              "vector from the tip to the reflector or ball, in the tool frame")
      .number("radius_mm", &Instrument::radius, positive,
              "radius of circles and of the bar; distance of a ball from a rotary axis")
      .number(
          typical_value("lever_mm"), &Instrument::lever, positive,
          "distance between the parallel lines, or between the two heights of a spindle artefact")
      .number("from_deg", &Instrument::from_rad, any_number,
              "start angle of the arc of circles and rotary axes, limited to the travel of an axis")
      .number("to_deg", &Instrument::to_rad, any_number, "end angle of that arc");
}

void check_interval(TableReader& reader, Instrument& instrument) {
  // Only these two kinds use the interval and the duration.
  const bool is_time_series =
      instrument.kind == Kind::Drift || instrument.kind == Kind::Temperature;
  if (is_time_series && instrument.interval_s > instrument.duration_s)
    reader.report_invalid(
        "interval_s",
        "an instrument.interval_s of at most instrument.duration_h, for at least two readings",
        fmt::format("{:g} s in {:g} h", instrument.interval_s, instrument.duration_s / 3600.0));
}

void add_times(Fields<Instrument>& fields) {
  fields
      .number("interval_s", &Instrument::interval_s, positive,
              "interval between readings of drift and temperature")
      .number("duration_h", &Instrument::duration_s, {0.0, 1e5},
              "duration of drift and temperature readings")
      .check(check_interval)
      .number("speed_mm_per_min", &Instrument::speed, speed, "speed between targets")
      .number(typical_value("dwell_s"), &Instrument::dwell_s, wait_s, "dwell at each target")
      .number(typical_value("set_up_min"), &Instrument::set_up_s, {0.0, 1e5},
              "time for one manual set-up; together with speed and dwell it gives the hours of a "
              "measurement")
      .number(typical_value("spindle_rpm"), &Instrument::spindle_speed, non_negative,
              "spindle speed during a spindle test and while drift is read");
}

void read_starts(TableReader& reader, InstrumentDescription& description) {
  const Node* node = reader.accept_key("start_h");
  if (!node) return;
  // A single number is allowed as a list of one start.
  if (!node->array()) {
    description.starts_s = {reader.number("start_h", any_number)};
    return;
  }
  const Eigen::VectorXd starts = reader.numbers("start_h");
  description.starts_s.assign(starts.begin(), starts.end());
}

void put_starts(const InstrumentDescription& description, Node::Table& table) {
  const auto& starts = description.starts_s;
  put_numbers(table, "start_h",
              Eigen::Map<const Eigen::VectorXd>(starts.data(), Eigen::Index(starts.size())),
              unit_factor("start_h"));
}

/// Returns all fields except kind and name. They are the same for all kinds; each kind uses those
/// that it needs.
Fields<InstrumentDescription> instrument_fields(Kind kind) {
  Fields<Instrument> fields;
  add_noise_fields(fields);
  add_targets(fields);
  add_times(fields);
  return Fields<InstrumentDescription>({metrology::typical_instrument(kind), {0.0}})
      .include_fields(&InstrumentDescription::instrument, fields)
      .custom_field({make_key(KeyName("start_h").with_fallback("0"), Key::Kind::Any,
                              "time of the first reading in hours, or a list of times: the whole "
                              "measurement is repeated from each, with a new set-up; 0 is the "
                              "start of the program, negative times lie in the history")},
                    read_starts, put_starts);
}

Fields<CoordinateMeasuringMachine> cmm_fields() {
  return Fields<CoordinateMeasuringMachine>()
      .number("noise_um", &CoordinateMeasuringMachine::noise, quality,
              "standard deviation of one reading")
      .number("resolution_um", &CoordinateMeasuringMachine::resolution, quality,
              "readings are multiples of it; 0: not rounded")
      .number("position_um", &CoordinateMeasuringMachine::alignment_sigma, {0.0, 1e4},
              "standard deviation of the position of the part")
      .number("alignment_urad", &CoordinateMeasuringMachine::alignment_sigma_rad, {0.0, 1e4},
              "standard deviation of the orientation of the part")
      .boolean("best_fit", &CoordinateMeasuringMachine::best_fit, "true: a rigid fit is removed")
      .number("interval_s", &CoordinateMeasuringMachine::interval_s, non_negative,
              "interval between readings");
}

TouchProbe default_probe(const MachineDescription& machine) {
  TouchProbe probe;
  // The default of the struct has no axis positions, as their number depends on the machine.
  probe.q = kinematics::AxisVector::Zero(Eigen::Index(machine.joints.size()));
  return probe;
}

Fields<TouchProbe> touch_probe_fields(const MachineDescription& machine) {
  return Fields<TouchProbe>(default_probe(machine))
      .vector("centre_mm", &TouchProbe::centre_t, "centre of the ball relative to the tip")
      .number("ball_radius_mm", &TouchProbe::radius, {1e-3, 1e3}, "radius of the stylus ball")
      .number("noise_um", &TouchProbe::noise, quality, "standard deviation of one touch")
      .number("resolution_um", &TouchProbe::resolution, quality,
              "readings are multiples of it; 0: not rounded")
      .number("clearance_mm", &TouchProbe::clearance, positive,
              "distance from the part at which the approach begins")
      .number("speed_mm_per_min", &TouchProbe::speed, speed, "speed between points")
      .number("dwell_s", &TouchProbe::dwell_s, wait_s, "dwell for each touch")
      .number("start_h", &TouchProbe::start_s, any_number,
              "time of the first touch, after the end of the program")
      .table(KeyName("pose").with_fallback("all at zero"), &TouchProbe::q,
             axis_position_fields(machine.joints), "positions of the rotary axes: { A_deg = 0 }");
}

/// Returns all fields except kind and name.
/// @param defaults  typical instrument of the kind
/// @param kind_fields  fields that only this kind has
template <typename PartInstrumentKind>
Fields<PartInstrument> part_instrument_kind_fields(const PartInstrumentKind& defaults,
                                                   const Fields<PartInstrumentKind>& kind_fields) {
  return Fields<PartInstrument>({"", "", defaults})
      .text(KeyName("case").with_fallback("uncompensated"), &PartInstrument::case_name,
            "case in which the part is cut")
      .number("spacing_mm", &PartInstrument::spacing, positive, "approximate spacing of the points")
      .include_fields(
          [](auto& part) -> auto& { return std::get<PartInstrumentKind>(part.device); },
          kind_fields);
}

Fields<PartInstrument> part_instrument_fields(const std::string& kind,
                                              const MachineDescription& machine) {
  if (kind == cmm) return part_instrument_kind_fields(CoordinateMeasuringMachine{}, cmm_fields());
  return part_instrument_kind_fields(default_probe(machine), touch_probe_fields(machine));
}

const Key& kind_key() {
  static const Key key = [] {
    Key kind_key = make_key(required_key("kind"), Key::Kind::Text,
                            "type of instrument, and its default accuracy");
    // The defaults depend on the kind, so each kind has a list of keys for the manual.
    for (const auto& [kind, sentence] : kinds)
      kind_key.choices.push_back(
          {metrology::to_string(kind), sentence, instrument_fields(kind).keys()});
    kind_key.choices.push_back(
        {cmm, "the part on a coordinate measuring machine; 0.5 µm, no alignment error",
         part_instrument_fields(cmm, {}).keys()});
    kind_key.choices.push_back(
        {touch_probe, "the part, still clamped, probed on the machine that cut it; 0.5 µm",
         part_instrument_fields(touch_probe, {}).keys()});
    return kind_key;
  }();
  return key;
}

std::string read_kind(TableReader& reader) {
  static const std::set<std::string> kind_names = choice_names(kind_key());
  std::string kind = reader.text("kind");
  if (kind.empty() || kind_names.contains(kind)) return kind;
  std::string list;
  for (const std::string& name : kind_names) list += (list.empty() ? "" : ", ") + name;
  const auto suggestion = nearest(kind, kind_names);
  reader.report_invalid(
      "kind", "one of " + list,
      "\"" + kind + "\"" + (suggestion ? " (did you mean " + *suggestion + "?)" : ""));
  return "";
}

InstrumentDescription read_instrument(TableReader& reader, Kind kind, const std::string& name,
                                      const MachineDescription& machine) {
  const std::size_t error_count = reader.input_errors().list().size();
  InstrumentDescription description = instrument_fields(kind).read(reader);
  description.instrument.name = name;
  reader.close();
  // A measuring plan needs a valid machine and a valid instrument.
  if (reader.input_errors().list().size() != error_count || machine.joints.empty())
    return description;
  try {
    // The plan is made only to test whether the instrument has targets on this machine.
    metrology::plan(description.instrument,
                    kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("kind", "an instrument that can measure this machine", error.what());
  }
  return description;
}

PartInstrument read_part_instrument(TableReader& reader, const std::string& kind,
                                    const std::string& name, const MachineDescription& machine) {
  PartInstrument description = part_instrument_fields(kind, machine).read(reader);
  description.name = name;
  reader.close();
  return description;
}

Node::Table named_instrument(const std::string& kind, const std::string& name,
                             Node::Table entries) {
  Node::Table table;
  put_value(table, "kind", kind);
  put_value(table, "name", name);
  append_entries(table, std::move(entries));
  return table;
}

}  // namespace

Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, InputErrors& input_errors) {
  Instruments instruments;
  std::set<std::string> names;
  for (const Node* node : tables) {
    TableReader reader(*node, "instrument", input_errors);
    const std::string kind = read_kind(reader);
    // The file of the readings has this name.
    const std::string name = reader.text("name", kind.empty() ? "?" : kind);
    if (!is_folder_name(name))
      reader.report_invalid("name", "a name of letters, digits, blanks, _ - . for a file", name);
    // Tables of an unknown kind would all have the same default name.
    if (!kind.empty() && !names.insert(name).second)
      reader.report_invalid(reader.has("name") ? "name" : "kind",
                            "a name that no other instrument has", "\"" + name + "\" again");
    if (!reader.has("kind")) reader.report_invalid("kind", "a kind such as \"laser\"", "none");
    if (kind.empty()) continue;
    // Part instruments are not kinds of the metrology module.
    if (is_part_instrument(kind))
      instruments.of_part.push_back(read_part_instrument(reader, kind, name, machine));
    else
      instruments.of_machine.push_back(
          read_instrument(reader, *metrology::find_kind(kind), name, machine));
  }
  return instruments;
}

std::vector<Node::Table> instruments_to_tables(const Instruments& instruments,
                                               const MachineDescription& machine) {
  std::vector<Node::Table> tables;
  for (const InstrumentDescription& description : instruments.of_machine)
    tables.push_back(named_instrument(
        metrology::to_string(description.instrument.kind), description.instrument.name,
        instrument_fields(description.instrument.kind).to_table(description)));
  for (const PartInstrument& description : instruments.of_part) {
    const char* kind =
        std::holds_alternative<CoordinateMeasuringMachine>(description.device) ? cmm : touch_probe;
    tables.push_back(named_instrument(kind, description.name,
                                      part_instrument_fields(kind, machine).to_table(description)));
  }
  return tables;
}

std::vector<Key> instrument_keys() {
  return {kind_key(), make_key(KeyName("name").with_fallback("the kind"), Key::Kind::Text,
                               "name of the readings and of their file; must be unique")};
}

}  // namespace abbe::sim
