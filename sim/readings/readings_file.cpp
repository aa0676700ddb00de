#include "sim/readings/readings_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

constexpr std::string_view first_part_line = "# abbe_part_readings = 1";
constexpr std::string_view columns = "x_mm,y_mm,z_mm,nx,ny,nz,deviation_um,time_s";
constexpr std::size_t width = 8;

using Row = std::array<double, width>;

/// Reads a row of readings of a part.
Row read_row(std::string_view line, int number, const std::string& file) {
  const std::vector<Cell> cells = split_cells(line, ',', width);
  const auto refuse = [&](int column, const std::string& expected, const std::string& seen) {
    throw BadInput(file, number, column, expected, seen);
  };
  if (cells.size() != width)
    refuse(1, fmt::format("{} cells: {}", width, columns), std::to_string(cells.size()));
  Row row{};
  for (std::size_t i = 0; i < width; ++i) {
    const auto x = number_of(cells[i].text);
    if (!x) refuse(cells[i].column, "a number within +-1e9", quoted_excerpt(cells[i].text));
    row[i] = *x;
  }
  // 1e-9: only rounding is tolerated, because normals are written with all their digits.
  if (std::abs(std::hypot(row[3], row[4], row[5]) - 1.0) > 1e-9)
    refuse(cells[3].column, "a normal of length 1", quoted_excerpt(line));
  return row;
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
  std::string header;
  LineReader lines(text);
  auto line = lines.next();
  // Comment lines form the TOML header. A blank replaces each '#', so that the columns in messages
  // are those of the file.
  for (; line && line->starts_with('#'); line = lines.next())
    header += " " + std::string(line->substr(1)) + "\n";
  if (!line || *line != columns)
    throw BadInput(file, lines.number(), 1, "the columns " + std::string(columns),
                   line ? quoted_excerpt(*line) : "the end of the file");
  const Node node = parse_toml(header, file);
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
  std::vector<Row> rows;
  while ((line = lines.next()))
    if (line->find_first_not_of(" \t") != std::string_view::npos)
      rows.push_back(read_row(*line, lines.number(), file));
  // The number of rows in the header reveals a truncated file.
  if (stated_rows > 0 && rows.size() != std::size_t(stated_rows))
    throw BadInput(file, 0, 0,
                   fmt::format("{} rows, as stated in `rows` of its header", stated_rows),
                   fmt::format("{}: the file was truncated or changed", rows.size()));
  errors::metrology::PartReadings& r = result.readings;
  const auto count = Eigen::Index(rows.size());
  r.points_w.resize(count, 3);
  r.normals_w.resize(count, 3);
  r.deviation.resize(count);
  r.time_s.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Row& row = rows[std::size_t(i)];
    for (int k = 0; k < 3; ++k) {
      r.points_w(i, k) = row[std::size_t(k)];
      r.normals_w(i, k) = row[std::size_t(3 + k)];
    }
    r.deviation[i] = row[6] * units::um;
    r.time_s[i] = row[7];
  }
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
      reader.input_errors().add(reader.place(), "a valid kinematic chain", error.what());
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

/// Reads the header, i.e. the leading lines with a #. Line numbers are kept, so that locations in
/// messages are those of the file.
ReadingsHeader read_header(std::string_view text, const std::string& file) {
  std::string toml;
  LineReader lines(text);
  while (const auto line = lines.next()) {
    if (!line->starts_with('#')) break;
    toml += " ";
    toml += line->substr(1);
    toml += '\n';
  }
  const Node node = parse_toml(toml, file);
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

/// Reader of the rows below the header.
class RowReader {
 public:
  RowReader(std::string_view text, const std::string& file, Readings& readings)
      : lines_(text, file), readings_(readings) {}

  void read() {
    read_columns();
    while (next_line()) read_row();
    if (readings_.plan.measurements.empty()) lines_.refuse(0, "at least one reading", "none");
    readings_.value = Eigen::Map<Eigen::VectorXd>(values_.data(), Eigen::Index(values_.size()));
    using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    readings_.T_C =
        Eigen::Map<RowMajorMatrix>(T_C_.data(), Eigen::Index(readings_.plan.measurements.size()),
                                   Eigen::Index(readings_.sensors.size()));
  }

 private:
  bool next_line() {
    const auto line = lines_.next();
    if (line) line_ = line->text;
    return line.has_value();
  }

  void read_columns() {
    if (!next_line()) lines_.refuse(1, "a line with the column names", "the end of the file");
    const auto& joints = readings_.nominal.joints();
    const std::string expected = column_names(joints, {});
    // The header determines the columns of the axes; only temperatures may follow.
    if (!line_.starts_with(expected))
      lines_.refuse(1, "columns that begin with " + expected, quoted_excerpt(line_));
    const std::string_view remaining_line = line_.substr(expected.size());
    if (remaining_line.empty()) return;
    const std::vector<Cell> cells = split_cells(remaining_line.substr(1), ',', max_sensors);
    if (remaining_line.front() != ',' || cells.size() > max_sensors)
      lines_.refuse(int(expected.size()) + 1, "columns of at most 1000 temperature sensors",
                    quoted_excerpt(remaining_line));
    for (const Cell& cell : cells) {
      const int column = int(expected.size()) + 1 + cell.column;
      if (!cell.text.ends_with("_C") || cell.text.size() < 3)
        lines_.refuse(column, "a temperature column such as nut_C", quoted_excerpt(cell.text));
      const std::string name(cell.text.substr(0, cell.text.size() - 2));
      const auto& sensors = readings_.sensors;
      if (std::find(sensors.begin(), sensors.end(), name) != sensors.end())
        lines_.refuse(column, "each sensor only once", quoted_excerpt(cell.text));
      readings_.sensors.push_back(name);
    }
  }

  void read_row() {
    const auto& joints = readings_.nominal.joints();
    const std::size_t axis_count = joints.size(),
                      width = 8 + 3 * axis_count + readings_.sensors.size();
    const std::vector<Cell> cells = split_cells(line_, ',', width);
    const std::string expected = fmt::format("{} cells, as in the line of column names", width);
    if (cells.size() < width)
      lines_.refuse(int(line_.size()) + 1, expected, std::to_string(cells.size()));
    if (cells.size() > width) lines_.refuse(cells[width].column, expected, "more");
    const auto& set_ups = readings_.plan.set_ups;
    Measurement measurement;
    measurement.set_up = lines_.read_whole_number(cells[0], 0, int(set_ups.size()) - 1);
    const auto& channels = set_ups[std::size_t(measurement.set_up)].channels;
    // A log of temperatures has a set-up without channels.
    measurement.channel = channels.empty()
                              ? lines_.read_whole_number(cells[1], -1, -1)
                              : lines_.read_whole_number(cells[1], 0, int(channels.size()) - 1);
    // The limits fit an int and are far above any real run.
    measurement.run = lines_.read_whole_number(cells[2], 0, 1000000);
    measurement.target = lines_.read_whole_number(cells[3], 0, 1000000000);
    measurement.state.time_s = lines_.number_in(cells[4]);
    measurement.state.q.resize(Eigen::Index(axis_count));
    for (std::size_t j = 0; j < axis_count; ++j) {
      measurement.state.q[Eigen::Index(j)] =
          lines_.number_in(cells[5 + 3 * j]) * position_unit(joints[j]);
      // Reversal errors depend on direction and stroke.
      measurement.state.direction[j] =
          std::int8_t(lines_.read_whole_number(cells[6 + 3 * j], -1, 1));
      measurement.state.stroke[j] = lines_.read_whole_number(cells[7 + 3 * j], 0, 1000000000);
    }
    const std::size_t first_cell_after_axes = 5 + 3 * axis_count;
    measurement.state.spindle_speed = lines_.number_in(cells[first_cell_after_axes]);
    read_value(
        cells[first_cell_after_axes + 1], cells[first_cell_after_axes + 2],
        measurement.channel < 0 ? "" : reading_unit(channels[std::size_t(measurement.channel)]));
    for (std::size_t k = first_cell_after_axes + 3; k < width; ++k)
      T_C_.push_back(lines_.number_in(cells[k]));
    readings_.plan.measurements.push_back(std::move(measurement));
  }

  void read_value(const Cell& value, const Cell& unit, std::string_view expected) {
    const bool is_empty = value.text.empty();
    const bool is_first = readings_.plan.measurements.empty();
    // Either every row has a reading or none has.
    if (is_empty != expected.empty() || (!is_first && is_empty != values_.empty()))
      lines_.refuse(value.column, "a reading for every channel, or only temperatures",
                    quoted_excerpt(value.text));
    if (unit.text != expected)
      lines_.refuse(
          unit.column,
          expected.empty() ? "no unit" : fmt::format("{}, the unit of its channel", expected),
          quoted_excerpt(unit.text));
    if (!is_empty) values_.push_back(lines_.number_in(value));
  }

  TableLineReader lines_;
  Readings& readings_;
  std::string_view line_;
  std::vector<double> values_, T_C_;
};

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
  RowReader(text, file, header.readings).read();
  if (const std::size_t rows = header.readings.plan.measurements.size();
      header.rows > 0 && rows != std::size_t(header.rows))
    throw BadInput(file, 0, 0,
                   fmt::format("{} rows, as stated in `rows` of its header", header.rows),
                   fmt::format("{}: the file was truncated or changed", rows));
  return std::move(header.readings);
}

Readings read_readings_file(const std::filesystem::path& file) {
  return read_readings(read_text(file, max_bytes), file.string());
}

}  // namespace abbe::sim
