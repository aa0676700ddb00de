#include "sim/readings/readings_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "kinematics/table_file.h"
#include "kinematics/units.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

constexpr std::string_view first_part_line = "# abbe_part_readings = 1";
constexpr std::string_view columns = "x_mm,y_mm,z_mm,nx,ny,nz,deviation_um,time_s";

TableSchema part_readings_schema() {
  TableSchema schema{.header = std::string(columns), .separators = ",", .min_rows = 0};
  for (const Cell& name : split_cells(columns, ',', 8))
    schema.columns.push_back({.names = {{std::string(name.text), unit_factor(name.text)}}});
  schema.leading_columns = schema.columns.size();
  return schema;
}

/// Returns the leading lines with a # as TOML. A blank replaces each #, so that the locations in
/// messages are those of the file.
std::string toml_header(std::string_view text) {
  std::string toml;
  LineReader lines(text);
  for (auto line = lines.next(); line && line->starts_with('#'); line = lines.next())
    toml += " " + std::string(line->substr(1)) + "\n";
  return toml;
}

/// Throws BadInput unless a file has the number of rows that its header states (0: not stated).
/// The number reveals a truncated file.
void check_row_count(std::size_t rows, int stated_rows, const std::string& file) {
  if (stated_rows > 0 && rows != std::size_t(stated_rows))
    throw BadInput(file, 0, 0,
                   fmt::format("{} rows, as stated in `rows` of its header", stated_rows),
                   fmt::format("{}: the file was truncated or changed", rows));
}

}  // namespace

std::string to_text(const PartReadingsFile& file) {
  const errors::metrology::PartReadings& r = file.readings;
  std::string text = fmt::format(
      "{}\n# instrument = {}\n# kind = {}\n# part = {}\n# sigma_um = {}\n# rows = {}\n{}\n",
      first_part_line, to_toml_value(file.instrument), to_toml_value(file.kind),
      to_toml_value(file.part), r.sigma / units::um, r.deviation.size(), columns);
  for (Eigen::Index i = 0; i < r.deviation.size(); ++i) {
    // fmt writes a double with the fewest digits that read back to the same bits.
    for (int k = 0; k < 3; ++k) text += fmt::format("{},", r.points_w(i, k));
    for (int k = 0; k < 3; ++k) text += fmt::format("{},", r.normals_w(i, k));
    text += fmt::format("{},{}\n", r.deviation[i] / units::um, r.time_s[i]);
  }
  return text;
}

bool is_part_readings_text(std::string_view text) { return text.starts_with(first_part_line); }

PartReadingsFile read_part_readings(std::string_view text, const std::string& file) {
  if (!is_part_readings_text(text))
    throw BadInput(file, 1, 1, "readings of a part",
                   quoted_excerpt(text.substr(0, text.find('\n'))));
  const Node node = parse_toml(toml_header(text), file);
  InputErrors input_errors;
  TableReader reader(node, "", input_errors);
  reader.integer("abbe_part_readings", 1, 1, 1);
  PartReadingsFile result;
  result.instrument = reader.text("instrument");
  result.kind = reader.text("kind");
  result.part = reader.text("part", "");
  result.readings.sigma = reader.number("sigma_um", non_negative, 0.0);
  const int stated_rows = reader.integer("rows", 0, 1000000000, 0);
  reader.close();
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  const TableFile table = read_table(text, file, part_readings_schema());
  check_row_count(table.rows(), stated_rows, file);
  errors::metrology::PartReadings& r = result.readings;
  r.points_w.resize(Eigen::Index(table.rows()), 3);
  r.normals_w.resize(Eigen::Index(table.rows()), 3);
  for (int k = 0; k < 3; ++k) {
    r.points_w.col(k) = table.values(std::size_t(k));
    r.normals_w.col(k) = table.values(std::size_t(3 + k));
  }
  r.deviation = table.values(6);
  r.time_s = table.values(7);
  // 1e-9: only rounding is tolerated, because normals are written with all their digits.
  for (std::size_t i = 0; i < table.rows(); ++i)
    if (std::abs(r.normals_w.row(Eigen::Index(i)).norm() - 1.0) > 1e-9)
      table.throw_cell_error(i, 3, "a normal of length 1", quoted_excerpt(table.row_text(i)));
  return result;
}

namespace {

namespace metrology = errors::metrology;
using Eigen::Vector3d;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using metrology::Body;
using metrology::Channel;
using metrology::Measurement;
using metrology::Quantity;
using metrology::Readings;
using metrology::SetUp;

constexpr std::string_view first_line = "# abbe_readings = 1";
// Limits on size and counts prevent a wrong file from exhausting the memory.
constexpr std::size_t max_bytes = std::size_t(256) << 20;
constexpr int max_rows = 1000000000;
constexpr std::size_t max_set_ups = 10000, max_channels = 250000, max_sensors = 1000;

constexpr std::array bodies{std::pair{"bed", Body::Bed}, std::pair{"workpiece", Body::Workpiece},
                            std::pair{"tool", Body::Tool}};
constexpr std::array quantities{
    std::pair{"length", Quantity::Length}, std::pair{"displacement", Quantity::Displacement},
    std::pair{"mirror", Quantity::Mirror}, std::pair{"angle", Quantity::Angle}};

/// Returns the name of an enum value in the file.
template <typename EnumNames, typename T>
const char* enum_name(const EnumNames& names, T value) {
  for (const auto& [name, entry] : names)
    if (entry == value) return name;
  return "";
}

bool is_slide(const Joint& joint) { return joint.motion == Motion::Linear; }
double position_unit(const Joint& joint) { return is_slide(joint) ? 1.0 : units::deg; }
const char* position_unit_name(const Joint& joint) { return is_slide(joint) ? "mm" : "deg"; }
const char* reading_unit(const Channel& channel) { return channel.is_angle() ? "rad" : "mm"; }

// Writing

/// Writer of the lines of the header.
class HeaderWriter {
 public:
  template <typename... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) {
    text_ += "# ";
    text_ += fmt::format(format, std::forward<Args>(args)...);
    text_ += '\n';
  }
  void number(const char* key, double value) { line("{} = {}", key, value); }
  /// Writes a number unless it has its default 0.
  void put_nonzero_number(const char* key, double value) {
    if (value != 0.0) number(key, value);
  }
  void vector(const char* key, const Vector3d& v) {
    line("{} = [{}, {}, {}]", key, v.x(), v.y(), v.z());
  }
  void string(const char* key, const std::string& value) {
    line("{} = {}", key, to_toml_value(value));
  }
  void pose(const char* key, const Pose& T) {
    std::string numbers;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 4; ++k)
        numbers += fmt::format("{}{}", numbers.empty() ? "" : ", ", T.matrix()(i, k));
    line("{} = [{}]", key, numbers);
  }
  std::string text() && { return std::move(text_); }

 private:
  std::string text_;
};

void write_joint(HeaderWriter& header, const Joint& joint) {
  header.line("[[joint]]");
  header.string("name", std::string(1, joint.name));
  header.string("side", joint.side == kinematics::Side::Tool ? "tool" : "workpiece");
  header.string("motion", joint.motion == Motion::Linear   ? "linear"
                          : joint.motion == Motion::Rotary ? "rotary"
                                                           : "spindle");
  header.vector("direction", joint.direction_b);
  header.vector("point_mm", joint.point_b);
  const double unit = position_unit(joint);
  header.line("travel_{} = [{}, {}]", position_unit_name(joint), joint.min / unit,
              joint.max / unit);
  if (joint.deviation_axes == kinematics::DeviationAxes::Turning)
    header.string("deviation_axes", "turning");
  if (joint.squareness == kinematics::Squareness::Travel) header.string("squareness", "travel");
}

void write_channel(HeaderWriter& header, const Channel& channel) {
  const bool is_angle = channel.is_angle();
  header.line("[[set_up.channel]]");
  header.string("name", channel.name);
  header.string("quantity", enum_name(quantities, channel.quantity));
  header.string("of", enum_name(bodies, channel.of));
  header.string("in", enum_name(bodies, channel.in));
  header.vector("point_of_mm", channel.point_of);
  header.vector("point_in_mm", channel.point_in);
  header.vector("direction", channel.direction_in);
  // Only a mirror has a normal.
  if (channel.quantity == Quantity::Mirror) header.vector("normal", channel.normal_of);
  header.put_nonzero_number(is_angle ? "noise_rad" : "noise_mm", channel.noise);
  header.put_nonzero_number(is_angle ? "resolution_rad" : "resolution_mm", channel.resolution);
}

void write_set_up(HeaderWriter& header, const SetUp& set_up) {
  header.line("[[set_up]]");
  header.string("name", set_up.name);
  if (!set_up.is_zero_unknown) header.line("zero_unknown = false");
  header.put_nonzero_number("rotation_sigma_rad", set_up.rotation_sigma);
  header.put_nonzero_number("point_of_sigma_mm", set_up.point_of_sigma);
  header.put_nonzero_number("point_in_sigma_mm", set_up.point_in_sigma);
  header.put_nonzero_number("normal_sigma_rad", set_up.normal_sigma);
  header.put_nonzero_number("eccentricity_sigma_mm", set_up.eccentricity_sigma);
  header.put_nonzero_number("scale_sigma", set_up.scale_sigma);
  header.put_nonzero_number("drift_sigma_per_s", set_up.drift_sigma);
  header.put_nonzero_number("set_up_s", set_up.set_up_s);
  for (const Channel& channel : set_up.channels) write_channel(header, channel);
}

/// Returns the header: all data needed to identify errors from the readings, but no truth.
std::string header_text(const Readings& readings) {
  HeaderWriter header;
  header.line("{}", first_line.substr(2));
  header.string("instrument", readings.plan.instrument);
  header.string("kind", readings.plan.kind);
  header.number("duration_s", readings.plan.duration_s);
  header.line("rows = {}", readings.plan.measurements.size());
  header.pose("T_bw_mm", readings.nominal.T_bw_home());
  header.pose("T_bt_mm", readings.nominal.T_bt_home());
  for (const Joint& joint : readings.nominal.joints()) write_joint(header, joint);
  for (const SetUp& set_up : readings.plan.set_ups) write_set_up(header, set_up);
  return std::move(header).text();
}

/// Returns the line with the names of the columns.
std::string column_names(const std::vector<Joint>& joints,
                         const std::vector<std::string>& sensors) {
  std::string text = "set_up,channel,run,target,time_s";
  for (const Joint& joint : joints)
    text += fmt::format(",{0}_{1},{0}_way,{0}_stroke", joint.name, position_unit_name(joint));
  text += ",spindle_rad_per_s,reading,unit";
  for (const std::string& sensor : sensors) text += "," + sensor + "_C";
  return text;
}

// Reading

Pose read_pose(TableReader& reader, const std::string& key) {
  // The file has three rows of the matrix; the fourth is 0 0 0 1.
  const Eigen::VectorXd numbers = reader.numbers(key, 12);
  Pose T = Pose::Identity();
  if (numbers.size() == 12)
    T.matrix().topRows<3>() =
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data());
  return T;
}

Joint read_joint(const Node& node, InputErrors& input_errors) {
  TableReader reader(node, "joint", input_errors);
  Joint joint;
  const std::string name = reader.text("name");
  if (name.size() == 1)
    joint.name = name.front();
  else if (!name.empty())
    reader.report_invalid("name", "one letter", quoted_excerpt(name));
  joint.side = reader.choice<kinematics::Side>(
      "side", {{"tool", kinematics::Side::Tool}, {"workpiece", kinematics::Side::Workpiece}});
  joint.motion = reader.choice<Motion>(
      "motion",
      {{"linear", Motion::Linear}, {"rotary", Motion::Rotary}, {"spindle", Motion::Spindle}});
  joint.direction_b = reader.vector("direction");
  joint.point_b = reader.vector("point_mm");
  const Eigen::VectorXd travel = reader.numbers(is_slide(joint) ? "travel_mm" : "travel_deg", 2);
  // Without two numbers the reader has already recorded the error.
  if (travel.size() == 2) {
    joint.min = travel[0];
    joint.max = travel[1];
  }
  using kinematics::DeviationAxes, kinematics::Squareness;
  joint.deviation_axes = reader.choice<DeviationAxes>(
      "deviation_axes", {{"fixed", DeviationAxes::Fixed}, {"turning", DeviationAxes::Turning}},
      DeviationAxes::Fixed);
  joint.squareness = reader.choice<Squareness>(
      "squareness", {{"frame", Squareness::Frame}, {"travel", Squareness::Travel}},
      Squareness::Frame);
  reader.close();
  return joint;
}

Body read_body(TableReader& reader, const std::string& key) {
  return reader.choice<Body>(
      key, {{"bed", Body::Bed}, {"workpiece", Body::Workpiece}, {"tool", Body::Tool}});
}

Vector3d read_unit(TableReader& reader, const std::string& key) {
  const Vector3d v = reader.vector(key);
  if (reader.has(key) && std::abs(v.norm() - 1.0) > 1e-9)
    reader.report_invalid(key, "a vector of length 1",
                          fmt::format("a vector of length {}", v.norm()));
  return v;
}

Channel read_channel(const Node& node, InputErrors& input_errors) {
  TableReader reader(node, "set_up.channel", input_errors);
  Channel channel;
  channel.name = reader.text("name", "");
  channel.quantity = reader.choice<Quantity>("quantity", {{"length", Quantity::Length},
                                                          {"displacement", Quantity::Displacement},
                                                          {"mirror", Quantity::Mirror},
                                                          {"angle", Quantity::Angle}});
  channel.of = read_body(reader, "of");
  channel.in = read_body(reader, "in");
  // A channel between two points of one body would always read zero.
  if (channel.of == channel.in)
    reader.report_invalid("in", "a body other than that of `of`", "the same body");
  channel.point_of = reader.vector("point_of_mm");
  channel.point_in = reader.vector("point_in_mm");
  channel.direction_in = read_unit(reader, "direction");
  if (channel.quantity == Quantity::Mirror) channel.normal_of = read_unit(reader, "normal");
  const std::string unit = reading_unit(channel);
  channel.noise = reader.number("noise_" + unit, non_negative, 0.0);
  channel.resolution = reader.number("resolution_" + unit, non_negative, 0.0);
  reader.close();
  return channel;
}

SetUp read_set_up(const Node& node, InputErrors& input_errors) {
  TableReader reader(node, "set_up", input_errors);
  SetUp set_up;
  set_up.name = reader.text("name");
  set_up.is_zero_unknown = reader.boolean("zero_unknown", true);
  set_up.rotation_sigma = reader.number("rotation_sigma_rad", non_negative, 0.0);
  set_up.point_of_sigma = reader.number("point_of_sigma_mm", non_negative, 0.0);
  set_up.point_in_sigma = reader.number("point_in_sigma_mm", non_negative, 0.0);
  set_up.normal_sigma = reader.number("normal_sigma_rad", non_negative, 0.0);
  set_up.eccentricity_sigma = reader.number("eccentricity_sigma_mm", non_negative, 0.0);
  set_up.scale_sigma = reader.number("scale_sigma", non_negative, 0.0);
  set_up.drift_sigma = reader.number("drift_sigma_per_s", non_negative, 0.0);
  set_up.set_up_s = reader.number("set_up_s", non_negative, 0.0);
  const auto channels = reader.tables("channel");
  if (channels.size() > max_channels)
    reader.report_invalid("channel", fmt::format("at most {} channels", max_channels),
                          std::to_string(channels.size()));
  else
    for (const Node* channel : channels)
      set_up.channels.push_back(read_channel(*channel, input_errors));
  reader.close();
  return set_up;
}

/// Reads the nominal machine; after an error returns a chain without joints.
kinematics::Chain read_machine(TableReader& reader) {
  std::vector<Joint> joints;
  const Pose T_bw = read_pose(reader, "T_bw_mm"), T_bt = read_pose(reader, "T_bt_mm");
  for (const Node* node : reader.tables("joint"))
    // One joint more than allowed is read, so that the chain reports the surplus.
    if (joints.size() <= kinematics::max_joints)
      joints.push_back(read_joint(*node, reader.input_errors()));
  if (reader.input_errors().empty()) {
    try {
      return kinematics::Chain(joints, T_bw, T_bt);
    } catch (const std::invalid_argument& error) {
      reader.input_errors().add(reader.position(), "a valid kinematic chain", error.what());
    }
  }
  // After an error the chain is not used.
  return kinematics::Chain({}, Pose::Identity(), Pose::Identity());
}

/// Content of the header of a file.
struct ReadingsHeader {
  Readings readings;  ///< without rows
  int rows = 0;       ///< stated number of rows; 0: not stated
};

/// Reads the header, i.e. the leading lines with a #.
ReadingsHeader read_header(std::string_view text, const std::string& file) {
  const Node node = parse_toml(toml_header(text), file);
  InputErrors input_errors;
  TableReader reader(node, "", input_errors);
  reader.integer("abbe_readings", 1, 1, 1);
  metrology::Plan plan;
  plan.instrument = reader.text("instrument");
  plan.kind = reader.text("kind");
  plan.duration_s = reader.number("duration_s", non_negative, 0.0);
  const int rows = reader.integer("rows", 0, max_rows, 0);
  kinematics::Chain nominal = read_machine(reader);
  const auto set_ups = reader.tables("set_up");
  if (set_ups.size() > max_set_ups)
    reader.report_invalid("set_up", fmt::format("at most {} set-ups", max_set_ups),
                          std::to_string(set_ups.size()));
  else
    for (const Node* set_up : set_ups) plan.set_ups.push_back(read_set_up(*set_up, input_errors));
  reader.close();
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  return {{std::move(plan), std::move(nominal), {}, {}, {}}, rows};
}

/// Returns the schema of the rows: set_up, channel, run, target and time_s, three columns for each
/// axis, spindle speed, reading and unit, then a column for each sensor.
TableSchema readings_schema(const Readings& readings) {
  using Content = TableColumn::Content;
  const std::vector<Joint>& joints = readings.nominal.joints();
  TableSchema schema{.header = column_names(joints, {"nut"}), .separators = ","};
  const auto add_integer = [&](const std::string& name, double min, double max) {
    schema.columns.push_back(
        {.names = {{name}}, .content = Content::Integer, .min = min, .max = max});
  };
  add_integer("set_up", 0, double(readings.plan.set_ups.size()) - 1);
  add_integer("channel", -1, double(max_channels));
  // The limits fit an int and are far above any real run.
  add_integer("run", 0, 1e6);
  add_integer("target", 0, 1e9);
  schema.columns.push_back({.names = {{"time_s"}}});
  for (const Joint& joint : joints) {
    schema.columns.push_back(
        {.names = {
             {fmt::format("{}_{}", joint.name, position_unit_name(joint)), position_unit(joint)}}});
    // Reversal errors depend on direction and stroke.
    add_integer(fmt::format("{}_way", joint.name), -1, 1);
    add_integer(fmt::format("{}_stroke", joint.name), 0, 1e9);
  }
  schema.columns.push_back({.names = {{"spindle_rad_per_s"}}});
  schema.columns.push_back({.names = {{"reading"}}, .content = Content::NumberOrEmpty});
  schema.columns.push_back({.names = {{"unit"}}, .content = Content::Text});
  schema.leading_columns = schema.columns.size();
  schema.max_columns = schema.columns.size() + max_sensors;
  schema.other_columns = [](std::string_view head) {
    const bool is_temperature = head.ends_with("_C") && head.size() > 2;
    return is_temperature ? std::optional(TableColumn{.names = {{std::string(head)}}})
                          : std::nullopt;
  };
  return schema;
}

/// Throws BadInput unless the channel and the unit of a row fit its set-up, and it has a reading
/// exactly if it has a channel and the first row has one.
void check_channel(const TableFile& table, std::size_t row, const Readings& readings) {
  const std::size_t unit_column = 7 + 3 * readings.nominal.joints().size();
  const std::size_t reading_column = unit_column - 1;
  const auto& channels = readings.plan.set_ups[std::size_t(table.value(row, 0))].channels;
  const int channel = int(table.value(row, 1));
  // A log of temperatures has a set-up without channels.
  const int min = channels.empty() ? -1 : 0, max = int(channels.size()) - 1;
  if (channel < min || channel > max)
    table.throw_cell_error(row, 1, fmt::format("an integer from {} to {}", min, max));
  const std::string_view unit = channel < 0 ? "" : reading_unit(channels[std::size_t(channel)]);
  const std::vector<double>& values = table.columns[reading_column].numbers;
  const bool is_empty = std::isnan(values[row]);
  if (is_empty != unit.empty() || is_empty != std::isnan(values[0]))
    table.throw_cell_error(row, reading_column,
                           "a reading for every channel, or only temperatures");
  if (table.columns[unit_column].texts[row] != unit)
    table.throw_cell_error(
        row, unit_column,
        unit.empty() ? "no unit" : fmt::format("{}, the unit of its channel", unit));
}

Measurement measurement_at(const TableFile& table, std::size_t row, std::size_t axis_count) {
  const auto integer = [&](std::size_t column) { return int(table.value(row, column)); };
  Measurement measurement;
  measurement.set_up = integer(0);
  measurement.channel = integer(1);
  measurement.run = integer(2);
  measurement.target = integer(3);
  measurement.state.time_s = table.value(row, 4);
  measurement.state.q.resize(Eigen::Index(axis_count));
  for (std::size_t j = 0; j < axis_count; ++j) {
    measurement.state.q[Eigen::Index(j)] = table.value(row, 5 + 3 * j);
    measurement.state.direction[j] = std::int8_t(integer(6 + 3 * j));
    measurement.state.stroke[j] = integer(7 + 3 * j);
  }
  measurement.state.spindle_speed = table.value(row, 5 + 3 * axis_count);
  return measurement;
}

/// Reads the rows below the header.
void read_rows(std::string_view text, const std::string& file, Readings& readings) {
  const TableSchema schema = readings_schema(readings);
  const TableFile table = read_table(text, file, schema);
  const std::size_t axis_count = readings.nominal.joints().size();
  for (std::size_t row = 0; row < table.rows(); ++row) {
    check_channel(table, row, readings);
    readings.plan.measurements.push_back(measurement_at(table, row, axis_count));
  }
  if (const std::size_t reading_column = 6 + 3 * axis_count;
      !std::isnan(table.columns[reading_column].numbers[0]))
    readings.value = table.values(reading_column);
  const std::size_t width = schema.columns.size();
  readings.T_C.resize(Eigen::Index(table.rows()), Eigen::Index(table.columns.size() - width));
  for (std::size_t k = width; k < table.columns.size(); ++k) {
    const std::string& head = table.columns[k].head;
    readings.sensors.push_back(head.substr(0, head.size() - 2));
    readings.T_C.col(Eigen::Index(k - width)) = table.values(k);
  }
}

}  // namespace

std::string to_text(const Readings& readings) {
  std::string text = header_text(readings);
  const auto& joints = readings.nominal.joints();
  text += column_names(joints, readings.sensors) + "\n";
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const Measurement& measurement = readings.plan.measurements[i];
    text += fmt::format("{},{},{},{},{}", measurement.set_up, measurement.channel, measurement.run,
                        measurement.target, measurement.state.time_s);
    for (std::size_t j = 0; j < joints.size(); ++j)
      text +=
          fmt::format(",{},{},{}", measurement.state.q[Eigen::Index(j)] / position_unit(joints[j]),
                      int(measurement.state.direction[j]), measurement.state.stroke[j]);
    text += fmt::format(",{},", measurement.state.spindle_speed);
    if (readings.value.size() > 0) text += fmt::format("{}", readings.value[Eigen::Index(i)]);
    const SetUp& set_up = readings.plan.set_ups[std::size_t(measurement.set_up)];
    text += ',';
    if (measurement.channel >= 0)
      text += reading_unit(set_up.channels[std::size_t(measurement.channel)]);
    for (Eigen::Index k = 0; k < readings.T_C.cols(); ++k)
      text += fmt::format(",{}", readings.T_C(Eigen::Index(i), k));
    text += '\n';
  }
  return text;
}

bool is_readings_text(std::string_view text) { return text.starts_with(first_line); }

Readings read_readings(std::string_view text, const std::string& file) {
  check_encoding(text, file);
  if (!is_readings_text(text))
    throw BadInput(file, 1, 1, "readings, whose first line is \"" + std::string(first_line) + "\"",
                   quoted_excerpt(text.substr(0, text.find('\n'))));
  ReadingsHeader header = read_header(text, file);
  read_rows(text, file, header.readings);
  check_row_count(header.readings.plan.measurements.size(), header.rows, file);
  return std::move(header.readings);
}

Readings read_readings_file(const std::filesystem::path& file) {
  return read_readings(read_text(file, max_bytes), file.string());
}

}  // namespace abbe::sim
