#include "sim/scene/program.h"

#include <algorithm>
#include <array>
#include <functional>
#include <string_view>
#include <system_error>

#include "kinematics/chain.h"
#include "kinematics/units.h"
#include "sim/dialects/read_options.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using dialects::ControlKind;
using dialects::Dialect;
using dialects::Interpreter;
using dialects::InterpreterLimits;
using dialects::PoleOptions;
using dialects::PoleRule;
using dialects::TurningOptions;
using dialects::UnknownWordPolicy;
using dialects::XWordMeaning;
using program::Flank;
using program::NcFormat;
using program::Raster;
using program::Spiral;
using File = ProgramDescription::File;
using Source = decltype(ProgramDescription::source);

constexpr Range spindle_rpm{0.0, 1e6, true, false};
constexpr Range tool_tilt_deg{-89.0, 89.0, false, false};

Fields<NcFormat> format_fields() {
  return Fields<NcFormat>()
      .integer("decimals_mm", &NcFormat::decimals_mm, 0, 15, "decimals of lengths in NC")
      .integer("decimals_deg", &NcFormat::decimals_deg, 0, 15, "decimals of angles in NC");
}

Fields<Raster> raster_fields() {
  return Fields<Raster>()
      .number("step_over_mm", &Raster::step_over, positive,
              "distance between passes, along the design")
      .number("step_mm", &Raster::step, positive,
              "distance between points of a pass, along the design")
      .number("lead_deg", &Raster::lead, tool_tilt_deg, "lead angle of the tool axis, forward")
      .number("tilt_deg", &Raster::tilt, tool_tilt_deg,
              "tilt angle of the tool axis, about the feed")
      .number("feed_mm_per_min", &Raster::feed, positive, "feed of the tip")
      .number_as_written("speed_rpm", &Raster::speed_rpm, spindle_rpm, "spindle speed")
      .number("clearance_mm", &Raster::clearance, positive,
              "clearance of the retract between passes")
      .choice("pattern", &Raster::zigzag,
              {{"zigzag", true, "to and fro"}, {"one_way", false, "all passes in one direction"}},
              "pattern of the passes")
      .number("overrun_mm", &Raster::overrun, non_negative,
              "distance by which passes extend beyond a declared surface")
      .include_fields(&Raster::format, format_fields());
}

Fields<Flank> flank_fields() {
  return Fields<Flank>()
      .number("step_mm", &Flank::step, positive, "distance between points, along the base")
      .number("feed_mm_per_min", &Flank::feed, positive, "feed of the tip")
      .number_as_written("speed_rpm", &Flank::speed_rpm, spindle_rpm, "spindle speed")
      .number("clearance_mm", &Flank::clearance, non_negative, "clearance of approach and retract")
      .number("tip_below_mm", &Flank::tip_below, non_negative,
              "distance by which the tip reaches below the base")
      .include_fields(&Flank::format, format_fields());
}

Fields<Spiral> spiral_fields() {
  return Fields<Spiral>()
      .number(required_key("speed_rpm"), &Spiral::spindle_speed, spindle_rpm, "spindle speed")
      .number(required_key("feed_um_per_rev"), &Spiral::feed_per_revolution, positive,
              "inward feed per revolution")
      // By default the cut starts one feed beyond the rim.
      .derive([](Spiral& spiral) { spiral.start_beyond_rim = spiral.feed_per_revolution; })
      .number(KeyName("start_beyond_rim_mm").with_fallback("the feed per revolution"),
              &Spiral::start_beyond_rim, non_negative,
              "distance beyond the rim at which the cut begins")
      .number("end_radius_mm", &Spiral::end_radius, non_negative,
              "radius at which the cut ends; 0: with one revolution on the axis")
      .number("interval_s", &Spiral::interval, positive, "interval between rows of PVT")
      .choice("format", &Spiral::write_nc, {{"pvt", false}, {"nc", true}}, "format of the program")
      .include_fields(&Spiral::format, format_fields());
}

void check_file(TableReader& reader, File& program) {
  const std::filesystem::path& file = program.file;
  const std::string extension = file.extension().string();
  std::error_code error_code;
  constexpr std::array<std::string_view, 18> known_extensions = {
      ".ngc", ".nc",  ".tap", ".cnc", ".gcode", ".eia", ".mpf", ".spf", ".h",
      ".cl",  ".cls", ".apt", ".ncl", ".txt",   ".min", ".iso", ".csv", ".pvt"};
  // How the file is read depends on its extension.
  if (std::find(known_extensions.begin(), known_extensions.end(), extension) ==
      known_extensions.end()) {
    reader.report_invalid(
        "file",
        "a program named .ngc, .nc, .tap, .cnc, .gcode, .eia, .mpf, .spf, .h, .cl, .cls, "
        ".apt, .ncl, .txt, .min, .iso, .csv or .pvt",
        file.string());
  } else if (!std::filesystem::is_regular_file(file, error_code)) {
    reader.report_invalid("file", "a file that can be read", missing_file_text(file));
  }
  const bool has_times = is_pvt(program);
  // A PVT table lists axis positions, so it has no tool vectors to which a pole rule would apply.
  if (has_times && program.pole.rule != PoleRule::AsProgrammed)
    reader.report_invalid("pole", "no pole with a table of times, which has no vectors", "one");
  if (has_times && !program.startup_code.empty())
    reader.report_invalid("startup_code", "none with a table of times", program.startup_code);
  if (program.interpreter != Interpreter::LinuxCnc) return;
  // The interpreter of LinuxCNC reads no other dialect.
  if (has_times || (program.dialect != Dialect::Auto && program.dialect != Dialect::LinuxCnc))
    reader.report_invalid("interpreter", "\"abbe\" with a program that is not LinuxCNC",
                          "\"linuxcnc\"");
}

void read_block_skip(TableReader& reader, File& program) {
  const std::string text = reader.text("block_skip", "on");
  if (const auto levels = program::parse_block_skip(text))
    program.block_skip = *levels;
  else
    reader.report_invalid("block_skip", "\"on\", \"off\" or levels such as \"1 3\"", text);
}

Fields<PoleOptions> pole_fields() {
  constexpr Range near_range{0.0, 45.0, true, false}, change_range{0.0, 90.0};
  return Fields<PoleOptions>()
      .choice(
          "pole", &PoleOptions::rule,
          {{"as_programmed", PoleRule::AsProgrammed, "the behaviour of the dialect"},
           {"linuxcnc", PoleRule::LinuxCnc,
            "rotary axes move as programmed, in a LinuxCNC program"},
           {"fanuc", PoleRule::Fanuc,
            "tool posture control, for G43.5 and cutter locations: a block that would pass close "
            "by a pole is led through it"},
           {"siemens", PoleRule::Siemens,
            "vectors on great circles, for Siemens and cutter locations"}},
          "the control's rule for tool vectors and near a pole")
      .only_if([](const PoleOptions& pole) { return pole.rule == PoleRule::Fanuc; },
               Fields<PoleOptions>()
                   .number(required_key("pole_near_deg"), &PoleOptions::near_angle, near_range,
                           "parameter 19738: a position nearer to a pole than this is close to it; "
                           "required with pole = \"fanuc\"")
                   .number(required_key("pole_change_deg"), &PoleOptions::max_rotation_about_pole,
                           change_range,
                           "parameter 19739: angle by which the end of a block may be turned about "
                           "the pole; required with pole = \"fanuc\""));
}

Fields<TurningOptions> turning_fields() {
  return Fields<TurningOptions>()
      .choice("control", &TurningOptions::control_kind,
              {{"of_machine", ControlKind::FromMachine,
                "a turning machine if a spindle S turns the workpiece, else a milling machine"},
               {"milling", ControlKind::Milling, "a milling machine"},
               {"turning", ControlKind::Turning, "a turning machine; Fanuc: G-code system A"}},
              "type of machine that the control is made for")
      .choice("x_words", &TurningOptions::x_words,
              {{"of_control", XWordMeaning::FromControl,
                "diameters on Fanuc and Siemens turning controls if X is perpendicular to the "
                "spindle line, else radii"},
               {"diameters", XWordMeaning::Diameters, "diameters"},
               {"radii", XWordMeaning::Radii, "radii"}},
              "what X means until the program changes it (G7, DIAMON)")
      .integer("tip", &TurningOptions::tip_number, 0, 9,
               "point of a round nose that X and Z guide without G41 and G42, as numbered by Fanuc "
               "and Siemens: 3 at X- Z- of its centre, 2 at X+ Z-; 0: its centre");
}

Fields<InterpreterLimits> interpreter_fields() {
  return Fields<InterpreterLimits>()
      .number("interpreter_limit_s", &InterpreterLimits::seconds, positive,
              "time after which LinuxCNC's own interpreter is stopped")
      .number("interpreter_limit_MB", &InterpreterLimits::megabytes, positive,
              "limit of its output of commands, about 120 bytes per move");
}

void read_control_table(TableReader& reader, ControlTableFile& table,
                        dialects::ControlTableKind kind) {
  if (table.file.empty()) return;
  try {
    table.table = dialects::read_control_table_file(table.file, kind, table.unit);
  } catch (const dialects::BadProgram& bad_program) {
    // Every error has its own line in the table.
    for (const BadInput& error : bad_program.input_errors) reader.input_errors().add(error);
  } catch (const BadInput&) {
    reader.report_invalid("file", "a file that can be read", missing_file_text(table.file));
  }
}

Fields<ControlTableFile> table_fields(dialects::ControlTableKind kind) {
  const bool is_tool_table = kind == dialects::ControlTableKind::Tools;
  return Fields<ControlTableFile>()
      .text(required_key("file"), &ControlTableFile::file,
            is_tool_table
                ? "tool table: LinuxCNC .tbl, a listing of Fanuc's G10 L10 to L13, Siemens TOA, "
                  "Heidenhain .t"
                : "work offsets: LinuxCNC .var, a listing of Fanuc's G10 L2 and L20, Siemens "
                  "UFR, Heidenhain .pr")
      .choice("unit", &ControlTableFile::unit,
              {{"as_stated", std::nullopt, "as stated in the file"},
               {"mm", 1.0, "millimetres"},
               {"inch", units::inch, "inches"}},
              "unit of its lengths; required if the file does not state it")
      .check([kind](TableReader& reader, ControlTableFile& table) {
        read_control_table(reader, table, kind);
      });
}

void check_table_keys(TableReader& reader, ProgramDescription& program) {
  // A table replaces these keys as a whole; with both, it would be unclear which value applies.
  if (program.tools && reader.has("tool_length_mm"))
    reader.report_invalid("tool_length_mm",
                          "either tool_length_mm or tools, which has every length", "both");
  if (program.offsets && reader.has("work_offset"))
    reader.report_invalid("work_offset", "either work_offset or offsets, which has all of them",
                          "both");
}

Fields<ProgramDescription> control_table_fields() {
  return Fields<ProgramDescription>()
      .table("tools", &ProgramDescription::tools, table_fields(dialects::ControlTableKind::Tools),
             "tool data believed by the control; the true tools are in [[tool]], by number")
      .table("offsets", &ProgramDescription::offsets,
             table_fields(dialects::ControlTableKind::Offsets),
             "work offsets of the control, in place of work_offset")
      .check(check_table_keys);
}

Fields<ProgramDescription> file_fields() {
  return Fields<ProgramDescription>().include_fields(
      [](auto& program) -> auto& { return std::get<File>(program.source); },
      Fields<File>()
          .text(required_key("file").in_exclusive_group("source"), &File::file,
                "program file: .csv and .pvt are position-velocity-time, others such as .ngc, .nc, "
                ".mpf, .h, .apt are machining programs")
          .choice("dialect", &File::dialect,
                  {{"auto", Dialect::Auto, "recognised by its content"},
                   {"linuxcnc", Dialect::LinuxCnc, "RS274/NGC"},
                   {"fanuc", Dialect::Fanuc, "Fanuc and similar"},
                   {"siemens", Dialect::Siemens, "840D"},
                   {"heidenhain", Dialect::Heidenhain, "Klartext"},
                   {"cl", Dialect::Cl, "cutter locations, APT or CSV"}},
                  "dialect of the program")
          .choice("on_unknown", &File::on_unknown,
                  {{"refuse", UnknownWordPolicy::Refuse, "all of them are reported at once"},
                   {"warn", UnknownWordPolicy::Warn, "they are skipped, and counted"}},
                  "treatment of words that the dialect does not know")
          .custom_field({make_key(KeyName("block_skip").with_fallback("on"), Key::Kind::Text,
                                  "operator's block skip switch for blocks after a /: \"on\" skips "
                                  "them, \"off\" executes them, \"1 3\" skips those of these "
                                  "levels; / alone is level 1 of Fanuc, else 0")},
                        read_block_skip,
                        [](const File& program, Node::Table& table) {
                          put_value(table, "block_skip", program::to_text(program.block_skip));
                        })
          .custom_field(
              {make_key(KeyName("startup_code").with_fallback("none"), Key::Kind::Text,
                        "a block of the dialect that is read before the first line, as the initial "
                        "state of a control: \"G20 G91\", \"T1 M6\"")},
              [](TableReader& reader, File& program) {
                program.startup_code = reader.text("startup_code", "");
              },
              [](const File& program, Node::Table& table) {
                if (!program.startup_code.empty())
                  put_value(table, "startup_code", program.startup_code);
              })
          .choice(
              "interpreter", &File::interpreter,
              {{"abbe", Interpreter::Abbe, "abbe's own interpreter"},
               {"linuxcnc", Interpreter::LinuxCnc,
                "LinuxCNC's rs274 as a separate process, unpacked by `./abbe setup --linuxcnc`"}},
              "interpreter of a LinuxCNC program")
          .include_fields(&File::interpreter_limits, interpreter_fields())
          .integer("max_moves", &File::max_moves, 1, 2'000'000'000,
                   "largest number of moves of the program, with every repetition of loops and "
                   "cycles counted; more is an input error")
          .include_fields(&File::pole, pole_fields())
          .include_fields(&File::turning, turning_fields())
          .number("pole_warning_deg", &File::pole_warning, Range{0.0, 45.0},
                  "angle from a pole: where the tool comes nearer, a warning states how the axis "
                  "that is free there turns; 0: none")
          .check(check_file));
}

Fields<ProgramDescription> generator_fields() {
  return Fields<ProgramDescription>().variant(
      required_key("generator").in_exclusive_group("source"), &ProgramDescription::source,
      {alternative<Source>("raster", raster_fields(), "parallel passes of a milling cutter"),
       alternative<Source>("flank", flank_fields(), "the flank of a cutter once around a cone"),
       alternative<Source>("spiral", spiral_fields(), "facing by a turning tool")},
      "generator of the program, if there is no `file`");
}

bool is_program_file(const ProgramDescription& program) {
  return std::holds_alternative<File>(program.source);
}

void select_source(TableReader& reader, ProgramDescription& program) {
  // Which of the following fields are read depends on the source.
  if (!reader.has("file")) program.source = Raster{};
  reader.accept_key("file");
  reader.accept_key("generator");
}

Key tool_length_key() {
  Key length =
      make_key("<H>", Key::Kind::Number, "length of the tool with this H number, 0 to 999");
  length.pattern = "[0-9]{1,3}";
  return make_key("tool_length_mm", Key::Kind::Table,
                  "tool lengths by H number, such as { 2 = 80.0 }; H1 is the tool in use",
                  {length});
}

void read_tool_lengths(TableReader& program, ProgramDescription& description) {
  const Node* section = program.section("tool_length_mm");
  if (!section) return;
  TableReader reader(*section, program.qualified_name("tool_length_mm"), program.input_errors());
  for (const Node::Entry& entry : *section->table()) {
    const bool is_h_number =
        entry.key.size() <= 3 && entry.key.find_first_not_of("0123456789") == std::string::npos;
    if (!is_h_number) {
      // Accepted, so that it is not reported as an unknown key as well.
      reader.accept_key(entry.key);
      program.input_errors().add(entry.position, "an H number from 0 to 999", entry.key);
      continue;
    }
    description.tool_length[std::stoi(entry.key)] = reader.number(entry.key, any_number);
  }
  reader.close();
}

void put_tool_lengths(const ProgramDescription& program, Node::Table& table) {
  Node::Table lengths;
  for (const auto& [h, length] : program.tool_length) put_value(lengths, std::to_string(h), length);
  if (!lengths.empty()) put_value(table, "tool_length_mm", std::move(lengths));
}

using Joints = std::vector<kinematics::Joint>;

Key work_offset_key() {
  Key offset = make_key("G<54..59>", Key::Kind::Table,
                        "origin of the words of the program: with rotary axes a position in the "
                        "workpiece, else positions of the slides",
                        axis_position_fields({}).keys());
  offset.pattern = "G5[4-9]";
  return make_key(
      "work_offset", Key::Kind::Table,
      "work offsets by the word that calls them, such as `G54 = { X_mm = 10, C_deg = 90 }`",
      {offset});
}

std::string work_offset_name(std::size_t i) { return "G" + std::to_string(54 + i); }

void read_work_offsets(TableReader& program, const Joints& joints,
                       ProgramDescription& description) {
  const Node* section = program.section("work_offset");
  if (!section) return;
  TableReader reader(*section, program.qualified_name("work_offset"), program.input_errors());
  for (std::size_t i = 0; i < description.work_offset.size(); ++i) {
    const Node* node = reader.section(work_offset_name(i));
    if (!node) continue;
    TableReader offset(*node, reader.qualified_name(work_offset_name(i)), program.input_errors());
    description.work_offset[i] = read_axis_positions(offset, joints);
    // If the machine is invalid, there are no joints, and every axis would be reported as unknown.
    if (!joints.empty()) offset.close();
  }
  reader.close();
}

void put_work_offsets(const ProgramDescription& program, const Joints& joints, Node::Table& table) {
  Node::Table offsets;
  for (std::size_t i = 0; i < program.work_offset.size(); ++i)
    // An empty vector stands for an offset that is not set.
    if (program.work_offset[i].size() > 0)
      put_value(offsets, work_offset_name(i),
                axis_position_fields(joints).to_table(program.work_offset[i]));
  if (!offsets.empty()) put_value(table, "work_offset", std::move(offsets));
}

/// Returns all fields except the work offsets, which depend on the axes of the machine.
const Fields<ProgramDescription>& program_fields() {
  static const Fields<ProgramDescription> fields =
      Fields<ProgramDescription>()
          .check(select_source)
          .only_if(is_program_file, file_fields())
          .only_if(is_program_file, control_table_fields())
          .only_if(std::not_fn(is_program_file), generator_fields())
          .custom_field({tool_length_key()}, read_tool_lengths, put_tool_lengths);
  return fields;
}

}  // namespace

bool is_pvt(const ProgramFile& program) {
  const std::string extension = program.file.extension().string();
  return program.dialect != Dialect::Cl && (extension == ".csv" || extension == ".pvt");
}

void check_offset_axes(dialects::ControlTable& offsets, const Joints& joints,
                       InputErrors& input_errors) {
  // Offsets of Siemens and Heidenhain are numbered from 500. Their tables may serve several
  // machines, and the control itself reports a call of an offset that it does not have.
  constexpr int first_removable_offset = 500;
  if (joints.empty()) return;
  const std::string letters = kinematics::letters(joints);
  std::string removed_names;
  std::erase_if(offsets.offsets, [&](const auto& entry) {
    const auto& [number, offset] = entry;
    bool fits_machine = true;
    for (const auto& [axis, value] : offset.axes) {
      // An offset of zero has no effect.
      if (value.value == 0.0 || letters.find(axis) != std::string::npos) continue;
      fits_machine = false;
      if (number < first_removable_offset)
        input_errors.add(BadInput(offsets.file, value.line, value.column,
                                  "an offset of an axis of this machine (" + letters + ")",
                                  std::string(1, axis)));
    }
    if (!fits_machine)
      removed_names += (removed_names.empty() ? "" : ", ") + offset_name(offsets.control, number);
    return !fits_machine;
  });
  if (!removed_names.empty())
    offsets.notes.push_back(
        offsets.file +
        ": left out, because they are for axes that this machine does not have: " + removed_names);
}

ProgramDescription read_program(const Node& table, const Joints& joints,
                                InputErrors& input_errors) {
  TableReader reader(table, "program", input_errors);
  ProgramDescription program = program_fields().read(reader);
  read_work_offsets(reader, joints, program);
  if (program.offsets) check_offset_axes(program.offsets->table, joints, input_errors);
  reader.close();
  return program;
}

Node::Table program_to_table(const ProgramDescription& program, const Joints& joints) {
  Node::Table table = program_fields().to_table(program);
  put_work_offsets(program, joints, table);
  return table;
}

std::vector<Key> program_keys() {
  std::vector<Key> keys = program_fields().keys();
  keys.push_back(work_offset_key());
  return keys;
}

}  // namespace abbe::sim
