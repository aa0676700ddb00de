#include "sim/scene/compensation.h"
#include "sim/scene/fields.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_fingerprint.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::PositionLoop;
using compensation::Strategy;

const MachineDescription& perfect_gantry() {
  static const MachineDescription machine = read_scene(packaged("gantry_perfect.toml")).machine;
  return machine;
}

BeliefDescription belief_of(const std::string& text) {
  InputErrors input_errors;
  BeliefDescription belief =
      read_belief(parse_toml(text, "s.toml"), perfect_gantry(), input_errors);
  EXPECT_EQ(text_of(input_errors), "");
  return belief;
}

std::string belief_faults(const std::string& text) {
  InputErrors input_errors;
  read_belief(parse_toml(text, "s.toml"), perfect_gantry(), input_errors);
  return text_of(input_errors);
}

CompensationDescription compensation_of(const std::string& text) {
  InputErrors input_errors;
  CompensationDescription result =
      read_compensation(parse_toml(text, "s.toml"), perfect_gantry().joints, input_errors);
  EXPECT_EQ(text_of(input_errors), "");
  return result;
}

std::string compensation_faults(const std::string& text) {
  InputErrors input_errors;
  read_compensation(parse_toml(text, "s.toml"), perfect_gantry().joints, input_errors);
  return text_of(input_errors);
}

/// What the reader of case names says when it refuses; empty if it does not.
std::string refusal_of_case(const std::string& name) {
  return thrown_text<std::invalid_argument>([&] { parse_case(name); });
}

// --- [compensation]

TEST(SceneCompensation, AnEmptySectionHasTheDefaultsOfTheHeaders) {
  const CompensationDescription read = compensation_of("");
  const CompensationDescription plain;
  EXPECT_EQ(read.rotary_bound, 0.1_deg);
  EXPECT_EQ(read.word_resolution, 1e-4);
  EXPECT_EQ(read.angle_resolution, 1e-4_deg);
  EXPECT_EQ(read.path_tolerance, 0.0);
  EXPECT_EQ(read.loop.order, PositionLoop{}.order);
  EXPECT_EQ(read.pulses.count, plain.pulses.count);
  EXPECT_EQ(read.pulses.cycle_s, 1e-3);
  EXPECT_EQ(read.open.cycle_s, compensation::OpenControl{}.cycle_s);
  EXPECT_EQ(read.origin.increment, compensation::OriginShift{}.increment);
  EXPECT_EQ(read.table.options.max_points, 256);
  EXPECT_FALSE(read.table.format);
  EXPECT_FALSE(read.table.reference);
  EXPECT_EQ(read.piezo.range, compensation::Piezo{}.range);
  EXPECT_EQ(read.plug_in.strategy, Strategy::Iterated);
  EXPECT_EQ(read.plug_in.channel, Channel::Ideal);
}

constexpr const char* every_key = R"(
rotary_bound_deg = 0.5
word_resolution_mm = 0.001
angle_resolution_deg = 0.002
path_tolerance_um = 0.25
plug_in = "position-pulses"
[loop]
order = "second"
bandwidth_Hz = 30
damping = 0.6
[pulses]
count_um = 0.5
count_deg = 0.0004
cycle_ms = 2
pulse_ms = 0.004
[open]
cycle_ms = 4
delay_ms = 3
[origin]
cycle_ms = 12
delay_ms = 5
increment_um = 2
rate_mm_per_min = 30
[table]
most_points = 64
spacing_mm = 2.5
spacing_deg = 1
cross = false
both_ways = false
constant = false
format = "siemens"
reference = { X_mm = 10, A_deg = 30 }
[piezo]
direction = [0, 3, 4]
range_um = 40
stiffness_N_per_um = 80
resolution_nm = 5
cycle_ms = 0.5
[piezo.loop]
order = "first"
bandwidth_Hz = 200
)";

TEST(SceneCompensation, EveryKeyIsReadInInternalUnits) {
  const CompensationDescription c = compensation_of(every_key);
  EXPECT_DOUBLE_EQ(c.rotary_bound, 0.5_deg);
  EXPECT_EQ(c.word_resolution, 0.001);
  EXPECT_DOUBLE_EQ(c.angle_resolution, 0.002_deg);
  EXPECT_DOUBLE_EQ(c.path_tolerance, 0.25_um);
  EXPECT_EQ(c.plug_in.strategy, Strategy::Position);
  EXPECT_EQ(c.plug_in.channel, Channel::PulseInsertion);
  EXPECT_EQ(c.loop.order, PositionLoop::Order::Second);
  EXPECT_EQ(c.loop.bandwidth, 30.0);
  EXPECT_EQ(c.loop.damping, 0.6);
  EXPECT_DOUBLE_EQ(c.pulses.count, 0.5_um);
  EXPECT_DOUBLE_EQ(c.pulses.count_rad, 0.0004_deg);
  EXPECT_DOUBLE_EQ(c.pulses.cycle_s, 2e-3);
  EXPECT_DOUBLE_EQ(c.pulses.pulse_s, 4e-6);
  EXPECT_DOUBLE_EQ(c.open.cycle_s, 4e-3);
  EXPECT_DOUBLE_EQ(c.open.delay_s, 3e-3);
  EXPECT_DOUBLE_EQ(c.origin.cycle_s, 12e-3);
  EXPECT_DOUBLE_EQ(c.origin.delay_s, 5e-3);
  EXPECT_DOUBLE_EQ(c.origin.increment, 2.0_um);
  EXPECT_DOUBLE_EQ(c.origin.rate, 0.5);
  EXPECT_EQ(c.table.options.max_points, 64);
  EXPECT_EQ(c.table.options.spacing, 2.5);
  EXPECT_DOUBLE_EQ(c.table.options.spacing_rad, 1.0_deg);
  EXPECT_FALSE(c.table.options.cross);
  EXPECT_FALSE(c.table.options.has_direction_columns);
  EXPECT_FALSE(c.table.options.constant);
  EXPECT_EQ(c.table.format, compensation::ControlFormat::Siemens);
  ASSERT_TRUE(c.table.reference);
  EXPECT_EQ((*c.table.reference)[1], 10.0);
  EXPECT_DOUBLE_EQ((*c.table.reference)[4], 30.0_deg);
  EXPECT_EQ((*c.table.reference)[3], 0.0);
  EXPECT_TRUE(c.piezo.direction_t.isApprox(Vector3d(0, 0.6, 0.8), 1e-15));
  EXPECT_DOUBLE_EQ(c.piezo.range, 40.0_um);
  EXPECT_DOUBLE_EQ(c.piezo.stiffness, 80e3);
  EXPECT_DOUBLE_EQ(c.piezo.resolution, 5.0_nm);
  EXPECT_DOUBLE_EQ(c.piezo.cycle_s, 0.5e-3);
  EXPECT_EQ(c.piezo.loop.order, PositionLoop::Order::First);
  EXPECT_EQ(c.piezo.loop.bandwidth, 200.0);
}

TEST(SceneCompensation, UnknownKeysAreRefusedWithTheNearestOne) {
  const struct {
    const char *text, *nearest, *seen;
  } cases[] = {
      {"rotry_bound_deg = 1", "compensation.rotary_bound_deg", "rotry_bound_deg"},
      {"[pulse]\ncount_um = 1", "compensation.pulses", "pulse"},
      {"[pulses]\ncounts_um = 1", "compensation.pulses.count_um", "counts_um"},
      {"[open]\ndelays_ms = 1", "compensation.open.delay_ms", "delays_ms"},
      {"[origin]\nincrements_um = 1", "compensation.origin.increment_um", "increments_um"},
      {"[table]\nspacings_mm = 1", "compensation.table.spacing_mm", "spacings_mm"},
      {"[piezo]\nrange_m = 1", "compensation.piezo.range_um", "range_m"},
      {"[loop]\norder = \"first\"\nbandwith_Hz = 1", "compensation.loop.bandwidth_Hz",
       "bandwith_Hz"},
      {"[piezo.loop]\norder = \"first\"\ndampng = 1", "compensation.piezo.loop.damping", "dampng"},
  };
  for (const auto& one : cases) {
    const std::string input_errors = compensation_faults(one.text);
    EXPECT_HAS(input_errors, one.nearest);
    EXPECT_HAS(input_errors, one.seen);
  }
}

TEST(SceneCompensation, UnitsThatDoNotFitAreRefused) {
  EXPECT_EQ(compensation_faults("[origin]\nincrement_mm = 0.001"),
            "s.toml:2:1: expected compensation.origin.increment_um in um, seen increment_mm in "
            "mm\n");
  EXPECT_EQ(compensation_faults("rotary_bound_urad = 100"),
            "s.toml:1:1: expected compensation.rotary_bound_deg in deg, seen rotary_bound_urad in "
            "urad\n");
  EXPECT_NE(compensation_faults("[table.reference]\nA_mm = 3"), "");
  EXPECT_NE(compensation_faults("[table.reference]\nQ_mm = 3"), "");
}

TEST(SceneCompensation, NumbersOutsideTheirRangesAreRefusedAtTheirPlace) {
  for (const char* text :
       {"rotary_bound_deg = -0.1", "rotary_bound_deg = 181", "rotary_bound_deg = nan",
        "word_resolution_mm = 0", "angle_resolution_deg = -1e-4", "path_tolerance_um = -1",
        "word_resolution_mm = inf", "rotary_bound_deg = \"0.1\""}) {
    EXPECT_EQ(compensation_faults(text).rfind("s.toml:1:", 0), 0u) << text;
  }
  for (const char* text : {"[loop]\nbandwidth_Hz = 0\norder = \"first\"",
                           "[pulses]\ncount_um = 0",
                           "[pulses]\ncount_deg = 11",
                           "[pulses]\ncycle_ms = 0",
                           "[pulses]\npulse_ms = -1",
                           "[open]\ncycle_ms = 0",
                           "[open]\ndelay_ms = -1",
                           "[open]\ncycle_ms = 1e7",
                           "[origin]\ncycle_ms = 0",
                           "[origin]\nincrement_um = -1",
                           "[origin]\nrate_mm_per_min = -1",
                           "[table]\nmost_points = 1",
                           "[table]\nmost_points = 2.5",
                           "[table]\nspacing_mm = 0",
                           "[table]\nspacing_deg = 361",
                           "[table]\ncross = 1",
                           "[piezo]\nrange_um = 0",
                           "[piezo]\nstiffness_N_per_um = 0",
                           "[piezo]\nresolution_nm = -1",
                           "[piezo]\ndirection = [0, 0, 0]",
                           "[piezo]\ndirection = [0, 1]"}) {
    EXPECT_EQ(compensation_faults(text).rfind("s.toml:2:", 0), 0u)
        << text << " gives: " << compensation_faults(text);
  }
}

TEST(SceneCompensation, WordsThatAreNotOnTheListAreRefusedWithTheList) {
  const std::string order = compensation_faults("[loop]\norder = \"third\"");
  for (const char* word : {"none", "first", "second", "third"}) EXPECT_HAS(order, word);
  const std::string format = compensation_faults("[table]\nformat = \"fanuc\"");
  for (const char* word : {"linuxcnc", "isg", "siemens", "heidenhain", "fanuc"})
    EXPECT_HAS(format, word);
  EXPECT_NE(compensation_faults("[loop]\nbandwidth_Hz = 3"), "") << "a loop has an order";
}

TEST(SceneCompensation, AllFaultsAreReportedAtOnce) {
  const std::string input_errors = compensation_faults(
      "rotary_bound_deg = -1\nplug_in = \"iterated\"\n[pulses]\ncount_um = 0\n[opne]\n");
  for (const char* word : {"rotary_bound_deg", "strategy-channel", "count_um", "opne"})
    EXPECT_HAS(input_errors, word);
}

TEST(SceneCompensation, APlugInsStrategyAndChannelAreTwoTokens) {
  EXPECT_EQ(compensation_of("plug_in = \"decoupled-piezo\"").plug_in.channel, Channel::Piezo);
  const std::string one = compensation_faults("plug_in = \"iterated\"");
  EXPECT_HAS(one, "strategy-channel such as iterated-ideal");
  const std::string bad = compensation_faults("plug_in = \"iterated-wire\"");
  EXPECT_HAS(bad, "expected a channel (ideal, program, pulses, open, origin, table, piezo)");
  EXPECT_NE(compensation_faults("plug_in = \"perfect-iterated-ideal\""), "");
  EXPECT_NE(compensation_faults("plug_in = 3"), "");
}

// --- case names

TEST(CaseName, EveryTokenIsRead) {
  const std::pair<const char*, Belief> beliefs[] = {
      {"perfect", Belief::Perfect}, {"identified", Belief::Identified},
      {"thermal", Belief::Thermal}, {"composite", Belief::Composite},
      {"force", Belief::Force},     {"part", Belief::Part},
      {"fused", Belief::Fused}};
  const std::pair<const char*, Strategy> strategies[] = {{"position", Strategy::Position},
                                                         {"decoupled", Strategy::Decoupled},
                                                         {"iterated", Strategy::Iterated}};
  const std::pair<const char*, Channel> channels[] = {
      {"ideal", Channel::Ideal}, {"program", Channel::Program}, {"pulses", Channel::PulseInsertion},
      {"open", Channel::Open},   {"origin", Channel::Origin},   {"table", Channel::Table},
      {"piezo", Channel::Piezo}};
  for (const auto& [belief, as_belief] : beliefs)
    for (const auto& [strategy, as_strategy] : strategies)
      for (const auto& [channel, as_channel] : channels) {
        const std::string name = fmt::format("{}-{}-{}", belief, strategy, channel);
        const CaseDescription one = parse_case(name);
        EXPECT_EQ(one.name, name);
        EXPECT_EQ(one.belief, as_belief);
        EXPECT_EQ(one.strategy, as_strategy);
        EXPECT_EQ(one.channel, as_channel);
        EXPECT_TRUE(one.plug_in.empty());
      }
}

TEST(CaseName, EachTokenIsRefusedWithWhatItCouldBe) {
  EXPECT_EQ(refusal_of_case("perfekt-iterated-ideal"),
            "expected a belief (perfect, identified, thermal, composite, force, part, fused), seen "
            "\"perfekt\" (nearest: \"perfect\")");
  EXPECT_EQ(refusal_of_case("perfect-twice-ideal"),
            "expected a strategy (position, decoupled, iterated), seen \"twice\"");
  EXPECT_EQ(refusal_of_case("perfect-iterated-wire"),
            "expected a channel (ideal, program, pulses, open, origin, table, piezo), seen "
            "\"wire\"");
  for (const char* name :
       {"", "-", "--", "---", "perfect", "perfect-iterated", "perfect-iterated-ideal-",
        "Perfect-iterated-ideal", " perfect-iterated-ideal", "perfect--iterated-ideal"})
    EXPECT_NE(refusal_of_case(name), "") << "\"" << name << "\"";
}

TEST(CaseName, ADotOrASlashMakesItAPlugInCalledByItsFileName) {
  const CaseDescription one = parse_case("./folder/../mine.py");
  EXPECT_EQ(one.name, "mine.py");
  EXPECT_TRUE(one.plug_in.is_absolute());
  EXPECT_EQ(one.plug_in.filename(), "mine.py");
  EXPECT_EQ(one.plug_in.string().find(".."), std::string::npos);
  EXPECT_EQ(parse_case("/usr/lib/mine.so").plug_in, "/usr/lib/mine.so");
  EXPECT_EQ(plug_in_case("mine").name, "mine");
  for (const char* name : {"/", "a/", ".", "..", "./", "a/..", "./a\nb.py", "a;b.py"})
    EXPECT_NE(refusal_of_case(name), "") << "\"" << name << "\"";
}

TEST(SceneCompensation, WhatIsWrittenReadsAsTheSame) {
  for (const char* text : {every_key, ""}) {
    const Node written{{}, compensation_to_table(compensation_of(text), perfect_gantry().joints)};
    const CompensationDescription again = compensation_of(to_toml(written));
    EXPECT_EQ(to_toml(Node{{}, compensation_to_table(again, perfect_gantry().joints)}),
              to_toml(written));
    EXPECT_EQ(again.table.format, compensation_of(text).table.format);
    EXPECT_EQ(again.plug_in.channel, compensation_of(text).plug_in.channel);
  }
}

// --- [belief]

TEST(SceneBelief, NothingIsBelievedWithoutASection) {
  const BeliefDescription belief = belief_of("");
  EXPECT_FALSE(belief.identified || belief.thermal || belief.force || belief.part);
  EXPECT_EQ(belief.scale, 1.0);
}

TEST(SceneBelief, ForceFromEachSourceIsReadInInternalUnits) {
  const auto current = belief_of(
      "[force]\nfrom = \"current\"\nsmoothing_ms = 500\npasses = 3\ntraining = { file = "
      "\"t.toml\", "
      "instrument = \"cmm\" }");
  ASSERT_TRUE(current.force);
  EXPECT_EQ(current.force->from, BeliefDescription::Force::From::Current);
  EXPECT_EQ(current.force->smoothing_s, 0.5);
  EXPECT_EQ(current.force->passes, 3);
  EXPECT_EQ(current.force->training, "t.toml");
  EXPECT_EQ(current.force->instrument, "cmm");
  const auto dynamometer = belief_of(
      "[force]\nfrom = \"dynamometer\"\n[force.compliance.axis.X]\nstiffness_N_per_um = [80, 60, "
      "100]");
  ASSERT_TRUE(dynamometer.force);
  EXPECT_EQ(dynamometer.force->smoothing_s, 0.0);
  EXPECT_EQ(dynamometer.force->passes, 2);
  ASSERT_EQ(dynamometer.force->compliance.joints.size(), 1u);
  EXPECT_DOUBLE_EQ(dynamometer.force->compliance.joints[0].C(0, 0), 1.0 / 80e3);
  const auto model = belief_of(
      "[force]\nfrom = \"model\"\n[force.compliance.axis.Z]\nstiffness_N_per_um = [80, "
      "60, 100]");
  EXPECT_EQ(model.force->from, BeliefDescription::Force::From::Model);
}

TEST(SceneBelief, PartAndScaleAreRead) {
  const BeliefDescription belief =
      belief_of("scale = -2\n[part]\ninstrument = \"cmm\"\npasses = 4");
  ASSERT_TRUE(belief.part);
  EXPECT_EQ(belief.part->instrument, "cmm");
  EXPECT_EQ(belief.part->passes, 4);
  EXPECT_EQ(belief.scale, -2.0);
  EXPECT_EQ(belief_of("[part]\ninstrument = \"cmm\"").part->passes, 1);
}

TEST(SceneBelief, FaultsAreReportedAtTheirPlace) {
  const struct {
    const char *text, *place, *word;
  } cases[] = {
      {"scale = 1e7", "s.toml:1:", "scale"},
      {"scale = nan", "s.toml:1:", "scale"},
      {"identifed = {}", "s.toml:1:", "belief.identified"},
      {"identified = { EXQ_um = 3 }", "s.toml:1:", "EXQ_um"},
      {"identified = { EXX_mm = 3 }", "s.toml:1:", "EXX_um"},
      {"[thermal]\nfiel = \"a.txt\"", "s.toml:", "file"},
      {"[thermal]", "s.toml:1:", "file"},
      {"[thermal]\nfile = \"/nonexistent/a.txt\"", "a.txt", "/nonexistent"},
      {"[thermal]\nfile = 3", "s.toml:2:", "file"},
      {"[force]", "s.toml:1:", "from"},
      {"[force]\nfrom = \"guess\"", "s.toml:2:", "dynamometer"},
      {"[force]\nfrom = \"model\"", "s.toml:1:", "compliance"},
      {"[force]\nfrom = \"dynamometer\"", "s.toml:1:", "compliance"},
      {"[force]\nfrom = \"current\"", "s.toml:1:", "training"},
      {"[force]\nfrom = \"current\"\ntraining = { file = \"t.toml\" }", "s.toml:3:", "instrument"},
      {"[force]\nfrom = \"current\"\ntraining = { instrument = \"cmm\" }", "s.toml:3:", "file"},
      {"[force]\nfrom = \"model\"\nsmoothing_ms = 5\ncompliance = {}", "s.toml:3:", "smoothing_ms"},
      {"[force]\nfrom = \"current\"\npasses = 0\ntraining = { file = \"t\", instrument = \"c\" }",
       "s.toml:3:", "passes"},
      {"[force]\nfrom = \"current\"\nsmoothing_s = 1\ntraining = { file = \"t\", instrument = "
       "\"c\" }",
       "s.toml:3:", "smoothing_ms"},
      {"[force]\nfrom = \"model\"\ncompliance = { axis = { Q = {} } }", "s.toml:3:", "Q"},
      {"[part]", "s.toml:1:", "instrument"},
      {"[part]\ninstrument = \"cmm\"\npasses = 21", "s.toml:3:", "passes"},
      {"[part]\ninstrument = \"\"", "s.toml:2:", "instrument"},
      {"thermal = 3", "s.toml:1:", "thermal"},
      {"part = [1]", "s.toml:1:", "part"},
  };
  for (const auto& one : cases) {
    const std::string input_errors = belief_faults(one.text);
    EXPECT_HAS(input_errors, one.place) << one.text;
    EXPECT_HAS(input_errors, one.word) << one.text;
  }
}

// --- in a scene

/// A small scene with some sections more.
std::string scene_text(const std::string& more) {
  return to_toml(
      BallRaster{"surface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = [0, "
                 "0, 80]\nvertices = 100",
                 1.0, 1.0, 36.0, "gantry_cxyza", more});
}

std::string scene_faults(const std::string& more) {
  const SceneFolder folder;
  return faults_of(folder.write("s.toml", scene_text(more)));
}

TEST(SceneBelief, ACaseWithoutItsBeliefIsRefusedByNameAndSection) {
  const std::pair<const char*, const char*> cases[] = {
      {"identified-position-ideal", "belief.identified"},
      {"thermal-position-ideal", "[belief.thermal]"},
      {"composite-position-ideal", "belief.identified"},
      {"composite-position-ideal", "[belief.thermal]"},
      {"force-position-ideal", "[belief.force]"},
      {"part-position-ideal", "[belief.part]"},
      {"fused-position-ideal", "an entry in [belief]"}};
  for (const auto& [name, section] : cases) {
    const std::string input_errors =
        scene_faults(fmt::format("[compare]\ncases = [\"{}\"]\n", name));
    EXPECT_HAS(input_errors, name);
    EXPECT_HAS(input_errors, section);
  }
  EXPECT_EQ(scene_faults("[compare]\ncases = [\"perfect-position-ideal\"]\n"), "");
  EXPECT_EQ(scene_faults("[belief]\nidentified = { EXX_um = 3 }\n[compare]\ncases = "
                         "[\"identified-position-ideal\", \"fused-iterated-program\"]\n"),
            "");
}

TEST(SceneBelief, ForceWantsACutAndTheSignalThatItIsReadFrom) {
  const std::string cutting =
      "[cutting]\nblank = \"box\"\nlower_mm = [-3, -3, -3]\nupper_mm = [3, 3, 0.5]\n";
  const std::string material = "[material]\nname = \"m\"\nsource = \"s\"\nK_tc_N_per_mm2 = 800\n";
  const std::string cases = "[compare]\ncases = [\"force-position-ideal\"]\n";
  const auto force = [](const std::string& from) {
    return "[belief.force]\nfrom = \"" + from +
           "\"\n[belief.force.compliance.axis.X]\nstiffness_N_per_um = [80, 60, 100]\n";
  };
  const std::string none = scene_faults(force("model") + cases);
  EXPECT_HAS(none, "[cutting] with a material for force-position-ideal");
  const std::string unread = scene_faults(force("dynamometer") + cases);
  EXPECT_HAS(unread, "[signals.dynamometer] for force-position-ideal");
  const std::string current = scene_faults(
      "[belief.force]\nfrom = \"current\"\ntraining = { file = \"t.toml\", instrument = \"cmm\" "
      "}\n" +
      cases);
  EXPECT_HAS(current, "[signals.current] for force-position-ideal");
}

TEST(SceneBelief, CasesAreRefusedAtTheirPlaceInTheList) {
  const std::string input_errors = scene_faults(
      "[compare]\ncases = [\"perfect-iterated-ideal\", \"perfect-iterated-ideal\",\n\"perfekt-"
      "iterated-ideal\", 3, \"./a.py\", \"b/a.py\"]\n");
  EXPECT_HAS(input_errors, "each case once, seen \"perfect-iterated-ideal\" again");
  EXPECT_HAS(input_errors, "expected a belief (perfect");
  EXPECT_HAS(input_errors, "a case name such as \"perfect-iterated-ideal\", seen 3");
  EXPECT_HAS(input_errors, "b/a.py\" again") << "two plug-ins would share a folder";
}

/// A thermal belief as a file has it.
std::string thermal_text() {
  compensation::ThermalBelief belief = *read_scene(packaged("gantry_warmup.toml")).belief.thermal;
  return compensation::to_text(belief);
}

TEST(SceneBelief, HostileBeliefFilesAreRefusedWithTheirPlace) {
  const SceneFolder folder;
  const std::string good = thermal_text();
  const auto faults_with_file = [&](const std::string& text) {
    folder.write("heat.txt", text);
    return faults_of(folder.write("s.toml", scene_text("[belief.thermal]\nfile = \"heat.txt\"\n")));
  };
  EXPECT_EQ(faults_with_file(good), "");
  EXPECT_NE(faults_with_file(""), "");
  EXPECT_NE(faults_with_file("hello\n"), "");
  EXPECT_NE(faults_with_file(good.substr(0, good.find("covariance") + 40)), "");
  EXPECT_NE(faults_with_file(std::string(1000, '\0')), "");
  EXPECT_NE(faults_with_file(good + good), "");
  const std::string huge = faults_with_file(std::string((std::size_t(16) << 20) + 1, '#'));
  EXPECT_HAS(huge, "heat.txt") << huge.substr(0, 300);
  const std::string absent =
      faults_of(folder.write("s.toml", scene_text("[belief.thermal]\nfile = \"absent.txt\"\n")));
  EXPECT_HAS(absent, "absent.txt");
  const std::string directory =
      faults_of(folder.write("s.toml", scene_text("[belief.thermal]\nfile = \".\"\n")));
  EXPECT_NE(directory, "");
  // errors that are believed, and what bends
  folder.write("wrong.toml", "EXX_um = 3\nEXQ_um = 4\n");
  const std::string wrong =
      faults_of(folder.write("s.toml", scene_text("[belief]\nidentified = \"wrong.toml\"\n")));
  EXPECT_HAS(wrong, "wrong.toml:2:1");
  folder.write("cut.toml", "EXX_um = [[[\n");
  const std::string cut =
      faults_of(folder.write("s.toml", scene_text("[belief]\nidentified = \"cut.toml\"\n")));
  EXPECT_HAS(cut, "cut.toml:");
  const std::string none =
      faults_of(folder.write("s.toml", scene_text("[belief]\nidentified = \"none.toml\"\n")));
  EXPECT_HAS(none, "none.toml");
}

TEST(SceneBelief, TheResolvedSceneReadsTheSameFromAnywhere) {
  const SceneFolder folder, elsewhere;
  folder.write("sub/heat.txt", thermal_text());
  folder.write("sub/believed.toml", "EXX_um = 3.25\nEC0Y_urad = -7\n");
  folder.write("sub/more.toml", "EYY_um = 1\n");
  folder.write("sub/soft.toml", "[axis.X]\nstiffness_N_per_um = [81, 60, 100]\n");
  const std::string text = scene_text(
      "[belief]\nidentified = [\"sub/believed.toml\", \"sub/more.toml\"]\nscale = 0.5\n"
      "[belief.thermal]\nfile = \"sub/heat.txt\"\n"
      "[belief.force]\nfrom = \"dynamometer\"\nsmoothing_ms = 3\ncompliance = \"sub/soft.toml\"\n"
      "[belief.part]\ninstrument = \"cmm\"\n"
      "[compensation]\nplug_in = \"position-open\"\n[compensation.table]\nformat = \"heidenhain\"\n"
      "reference = { X_mm = 1.5 }\n[compensation.pulses]\ncount_um = 0.3\n"
      "[compare]\ncases = [\"identified-position-table\", \"./tools/mine.py\"]\n"
      "[[variant]]\nname = \"other\"\nset = { \"belief.identified\" = \"sub/more.toml\" }\n");
  const Scene scene = read_scene(folder.write("s.toml", text));
  const Scene again = read_scene(elsewhere.write("s.toml", scene.resolved));
  EXPECT_EQ(fingerprint(scene), fingerprint(again));
  EXPECT_EQ(scene.resolved, again.resolved);
  EXPECT_EQ(scene.resolved.find("believed.toml"), std::string::npos) << "errors are read in";
  EXPECT_EQ(scene.resolved.find("soft.toml"), std::string::npos) << "compliance is read in";
  EXPECT_HAS(scene.resolved, (folder.path() / "sub/heat.txt").string())
      << "a data file is named from the root";
  EXPECT_EQ(scene.belief.force->compliance.joints.size(), 1u);
  EXPECT_EQ(scene.belief.identified->elements.size(), 3u);
  ASSERT_EQ(scene.cases.size(), 2u);
  EXPECT_EQ(scene.cases[1].plug_in, folder.path() / "tools/mine.py") << "a plug-in is, too";
  // the variant's file is found from the resolved scene as well
  for (const Scene* one : {&scene, &again}) {
    const Scene other = read_scene(one->file, one->variants[0].set);
    EXPECT_EQ(other.belief.identified->elements.size(), 1u);
  }
}

TEST(SceneBelief, TheSceneOfATrainingPartIsNamedFromTheRoot) {
  const SceneFolder folder, elsewhere;
  const std::string text = scene_text(
      "[belief.force]\nfrom = \"current\"\ntraining = { file = \"train/t.toml\", instrument = "
      "\"cmm\" }\n");
  const Scene scene = read_scene(folder.write("s.toml", text));
  EXPECT_EQ(scene.belief.force->training, folder.path() / "train/t.toml");
  const Scene again = read_scene(elsewhere.write("s.toml", scene.resolved));
  EXPECT_EQ(fingerprint(scene), fingerprint(again));
}

TEST(SceneBelief, ValuesAreChangedByTheirPaths) {
  const SceneFolder folder;
  const auto file = folder.write(
      "s.toml", scene_text("[belief]\nidentified = { EXX_um = 3 }\n[compensation.pulses]\ncount_um "
                           "= 1\n"));
  const Scene scene = read_scene(file, {{"belief.scale", "0"},
                                        {"compensation.pulses.count_um", "2"},
                                        {"belief.identified.EXX_um", "4"},
                                        {"compensation.origin.cycle_ms", "20"}});
  EXPECT_EQ(scene.belief.scale, 0.0);
  EXPECT_DOUBLE_EQ(scene.compensation.pulses.count, 2.0_um);
  EXPECT_DOUBLE_EQ(scene.compensation.origin.cycle_s, 0.02);
  EXPECT_NE(faults_of(file, {{"belief.scal", "0"}}), "");
  EXPECT_NE(faults_of(file, {{"compensation.pulses.count_mm", "1"}}), "");
}

TEST(SceneBelief, WhatIsWrittenReadsAsTheSame) {
  const SceneFolder folder;
  const std::string heat = folder.write("heat.txt", thermal_text()).string();
  const std::string part = "[part]\ninstrument = \"cmm\"\npasses = 3\n";
  for (const std::string& text :
       {std::string(), "scale = 0.5\nidentified = { EXX_um = 3, EC0Y_urad = 30 }\n" + part,
        "[thermal]\nfile = \"" + heat + "\"\n",
        std::string("[force]\nfrom = \"current\"\nsmoothing_ms = 5\npasses = 4\n"
                    "training = { file = \"/t.toml\", instrument = \"cmm\" }\n"),
        std::string("[force]\nfrom = \"model\"\n[force.compliance.axis.Z]\n"
                    "stiffness_N_per_um = [80, 60, 100]\n")}) {
    const std::string written =
        to_toml(Node{{}, belief_to_table(belief_of(text), perfect_gantry())});
    EXPECT_EQ(to_toml(Node{{}, belief_to_table(belief_of(written), perfect_gantry())}), written);
    EXPECT_EQ(belief_of(written).thermal.has_value(), belief_of(text).thermal.has_value());
    EXPECT_EQ(belief_of(written).force.has_value(), belief_of(text).force.has_value());
  }
}

}  // namespace
}  // namespace abbe::sim
