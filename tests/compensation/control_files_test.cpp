#include "sim/compensation/control_files.h"
#include "errors/element.h"
#include "errors/geometric.h"
#include "sim/compensation/time_series.h"
#include "tests/compensation/control_cases.h"
#include "tests/injured.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;
using errors::Constant;
using errors::Element;
using errors::GeometricErrors;

const std::string fodder = "0159.-+eE,;: \t\n\r\"#[]()=$*XYZAMNR/%";
constexpr std::size_t injuries = 2;

struct Outcome {
  int read = 0;
  int refused = 0;
};

/// Injures one file at a time; what is accepted must be sound.
template <typename Read>
Outcome outcome(const std::vector<ControlFile>& files, std::mt19937& random, const Read& read) {
  Outcome out;
  for (int k = 0; k < 4000; ++k) {
    std::vector<ControlFile> hurt = files;
    ControlFile& victim = hurt[std::size_t(k) % hurt.size()];
    victim.text = injured(victim.text, fodder, injuries, random);
    if (k % 50 == 0) victim.name = injured(victim.name, fodder, injuries, random);
    try {
      read(hurt);
      ++out.read;
    } catch (const BadInput& bad) {
      EXPECT_FALSE(bad.expected.empty() || bad.seen.empty()) << bad.what();
      EXPECT_GE(bad.line, 0);
      EXPECT_GE(bad.column, 0);
      ++out.refused;
    }
  }
  return out;
}

class ControlFilesFuzz : public testing::TestWithParam<ControlFormat> {};

TEST_P(ControlFilesFuzz, InjuredFilesAreReadOrRefused) {
  SeededRandom random(20250705);
  const Chain chain = gantry();
  const ParameterTables tables = any_tables(chain, random, {true, true, true, 6});
  const auto start = std::chrono::steady_clock::now();
  const Outcome out =
      outcome(to_control(tables, chain, GetParam()).files, random,
              [&](const std::vector<ControlFile>& files) {
                const ParameterTables back = read_control_tables(files, chain, GetParam());
                validate(back, chain);
                to_control(back, chain, GetParam());  // whatever was accepted can be written again
              });
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << to_string(GetParam()) << ": " << out.read << " read, " << out.refused << " refused, "
            << s << " s\n";
  EXPECT_GT(out.read, 100);
  EXPECT_GT(out.refused, 1000);
}

INSTANTIATE_TEST_SUITE_P(Formats, ControlFilesFuzz,
                         testing::Values(ControlFormat::LinuxCnc, ControlFormat::Siemens,
                                         ControlFormat::Heidenhain),
                         [](const auto& format) { return std::string(to_string(format.param)); });

TEST(ControlFiles, InjuredVolumetricFilesAreReadOrRefused) {
  SeededRandom random(20250706);
  const Chain chain = gantry();
  const std::vector<ControlFile> files = {
      {"X.csv", "// mm\nX EXX EYX EZX EAX EBX ECX\n0 1e-3 0 0 1e-6 0 0\n10 0 1e-3 0 0 0 2e-6\n"},
      {"all.csv", "A\tEAA\tEYA\n-30\t1e-6\t2e-3\n90\t0\t0\n#\nC0Y\tA0Z\tX0C\n1e-5\t0\t2e-3\n"}};
  const Outcome out = outcome(files, random, [&](const std::vector<ControlFile>& hurt) {
    errors::bind(read_volumetric_deviations(hurt, chain), chain);  // accepted is sound
  });
  std::cout << "isg: " << out.read << " read, " << out.refused << " refused\n";
  EXPECT_GT(out.read, 100);
  EXPECT_GT(out.refused, 1000);
}

TEST(ControlFiles, TooMuchIsRefusedBeforeItIsHeld) {
  const std::vector<ControlFile> many(65, ControlFile{"X.comp", ""});
  EXPECT_THROW(read_control_tables(many, gantry(), ControlFormat::LinuxCnc), BadInput);
  EXPECT_THROW(read_volumetric_deviations(many, gantry()), BadInput);
  const std::vector<ControlFile> large{{"X.comp", std::string((std::size_t(1) << 24) + 1, ' ')}};
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain})
    EXPECT_THROW(read_control_tables(large, gantry(), format), BadInput);
}

TEST(ControlFiles, NoTablesAreNoFiles) {
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain}) {
    EXPECT_TRUE(to_control(none(), gantry(), format).files.empty());
    EXPECT_TRUE(read_control_tables({}, gantry(), format).tables.empty());
  }
}

TEST(ControlFiles, PointsCloserThanTheDigitsAreReadOffAndSaid) {
  ParameterTables tables = none();
  tables.tables = {{X, X, Eigen::Vector4d(0, 1e-9, 5, 10), Eigen::Vector4d(0, 1e-3, 0, 0),
                    Eigen::Vector4d(0, 1e-3, 0, 0)},
                   {Y, Y, Vector2d(1, 1 + 1e-12), Vector2d(2e-3, 2e-3), Vector2d(2e-3, 2e-3)}};
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain}) {
    const ControlExport made = to_control(tables, gantry(), format);
    EXPECT_TRUE(says(made.omissions, "they deviate by")) << to_string(format);
    const ParameterTables back = read_control_tables(made.files, gantry(), format);
    AxisState state;
    state.q = AxisVector::Zero(6);
    EXPECT_NEAR(correction(back, state)[Y], 2e-3, 1e-9);
  }
}

ControlLog log_of_two() {
  ControlLog log;
  log.names = {"nut_C", "current_A"};
  log.time_s = Vector3d(-10.0, 0.0, 5.0);
  log.values.resize(3, 2);
  log.values << 20.0, 1.0, 21.0, 2.0, 22.0, 3.0;
  return log;
}

TEST(ControlLog, ColumnIsFoundByItsName) {
  EXPECT_EQ(column(log_of_two(), "current_A"), Vector3d(1.0, 2.0, 3.0));
}

TEST(ControlLog, AColumnThatIsNotThereIsNamedWithThoseThatAre) {
  const std::string text =
      thrown_text<std::invalid_argument>([&] { column(log_of_two(), "screw_C"); });
  for (const char* part : {"screw_C", "nut_C", "current_A"}) EXPECT_HAS(text, part);
  EXPECT_THROW(column(ControlLog{}, "nut_C"), std::invalid_argument);
  ControlLog narrow = log_of_two();
  narrow.values.conservativeResize(3, 1);
  EXPECT_THROW(column(narrow, "current_A"), std::invalid_argument);
}

TEST(ControlLog, TheControlKnowsTheLastRowThatWasRead) {
  const ControlLog log = log_of_two();
  EXPECT_EQ(row_at(log, -infinity), 0);
  EXPECT_EQ(row_at(log, -11.0), 0);
  EXPECT_EQ(row_at(log, -10.0), 0);
  EXPECT_EQ(row_at(log, -1e-12), 0);
  EXPECT_EQ(row_at(log, 0.0), 1);
  EXPECT_EQ(row_at(log, 4.999), 1);
  EXPECT_EQ(row_at(log, 5.0), 2);
  EXPECT_EQ(row_at(log, infinity), 2);
}

TEST(ControlLog, WithoutRowsOrAtNoInstantIsRefused) {
  EXPECT_THROW(row_at(ControlLog{}, 0.0), std::invalid_argument);
  EXPECT_THROW(row_at(log_of_two(), std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

GeometricErrors volumetric_errors(const std::string& text) {
  return read_volumetric_deviations(std::vector<ControlFile>{{"X.csv", text}}, gantry());
}

// laid out as the examples of the manual
const std::string example =
    "// component errors of X\n"
    "X      EXX    EYX    EZX    EAX    EBX    ECX\n"
    "0.0    0.02   0.01   0.07   0.00   0.0042 0.003\n"
    "10.0   0.00   -0.1   0.01   0.00   0.0011 0.002  // the last row\n"
    "# another head\n"
    "\n"
    "C0Y    A0Z    X0C\n"
    "0.1    0      0.11\n";

double value(const GeometricErrors& errors, const std::string& name, double command) {
  for (const Element& element : errors.elements)
    if (to_string(element.name) == name) {
      errors::CurveState state;
      state.command = command;
      return errors::value(element.curves.at(0), state);
    }
  throw std::runtime_error("no element " + name);
}

TEST(Isg, ComponentAndPositionErrorsAreRead) {
  const GeometricErrors errors = volumetric_errors(example);
  ASSERT_EQ(errors.elements.size(), 8u) << "a position error of zero says nothing";
  EXPECT_EQ(value(errors, "EYX", 10.0), -0.1);
  EXPECT_DOUBLE_EQ(value(errors, "EBX", 5.0), 0.5 * (0.0042 + 0.0011));
  EXPECT_EQ(value(errors, "EXX", -50.0), 0.02) << "constant outside";
  EXPECT_EQ(value(errors, "EC0Y", 0.0), 0.1);
  EXPECT_EQ(value(errors, "EX0C", 0.0), 0.11);
  EXPECT_NO_THROW(errors::bind(errors, gantry()));
}

TEST(Isg, RotaryArgumentsAreDegrees) {
  const GeometricErrors errors = volumetric_errors("A EAA\n0 1e-5\n90 3e-5\n");
  EXPECT_DOUBLE_EQ(value(errors, "EAA", 0.25 * pi), 2e-5);
}

GeometricErrors believed_waves() {
  const auto wave = [](double amplitude, double period) {
    return errors::Curve{errors::Fourier{VectorXd::Constant(1, amplitude),
                                         VectorXd::Constant(1, -0.4 * amplitude), period}};
  };
  const auto element = [](const char* name, std::vector<errors::Curve> curves) {
    return Element{errors::parse_element_name(name), std::move(curves)};
  };
  GeometricErrors errors;
  errors.elements = {element("EXX", {wave(8e-3, 300), {Constant{2e-3}}}),
                     element("EZX", {wave(3e-3, 500)}),
                     element("EBX", {wave(20e-6, 400)}),
                     element("EZY", {wave(5e-3, 450)}),
                     element("EAA", {wave(30e-6, 5.0)}),
                     element("EC0Y", {{Constant{40e-6}}}),
                     element("EB0C", {{Constant{-15e-6}}}),
                     element("EY0C", {{Constant{7e-3}}})};
  errors.measuring_lines = {{'X', {0, 100, 200}, errors::MeasuredBy::Tool}};
  return errors;
}

TEST(Isg, WhatIsBelievedComesBackAtItsPoints) {
  const Chain chain = gantry();
  const errors::GeometricModel model = errors::bind(believed_waves(), chain);
  TableOptions options;
  options.spacing = 10.0;
  const ControlExport made = to_volumetric(model, chain, options);
  EXPECT_TRUE(made.omissions.empty());
  EXPECT_EQ(made.files.size(), 4u) << "X Y A and the position errors; Z and C have nothing";
  EXPECT_EQ(file(made, "position_errors.csv").text,
            "// mm and rad\nY0C\tB0C\tC0Y\n0.007\t-1.5e-05\t4e-05\n");
  EXPECT_TRUE(file(made, "A.csv")
                  .text.starts_with("// mm and rad over deg\nA\tEXA\tEYA\tEZA\tEAA\tEBA\tECA\n-"));
  const errors::GeometricModel back =
      errors::bind(read_volumetric_deviations(made.files, chain), chain);
  double at_points = 0.0, between = 0.0;
  for (int k = 0; k <= 600; ++k) {
    AxisState state;
    state.q = AxisVector::Zero(6);
    state.q[X] = -300.0 + k;
    state.q[Y] = -200.0 + 450.0 * k / 600.0;
    const bool is_point = k % 10 == 0;
    const auto one = errors::deviations(model, state), two = errors::deviations(back, state);
    const double d = (one[X].motion - two[X].motion).cwiseAbs().maxCoeff();
    (is_point ? at_points : between) = std::max(is_point ? at_points : between, d);
    for (int i = 0; i < chain.size(); ++i)
      EXPECT_EQ(one[std::size_t(i)].location, two[std::size_t(i)].location);
  }
  const double bend = 8e-3 * std::hypot(1.0, 0.4) * std::pow(2.0 * pi / 300.0, 2) +
                      401.0 * 20e-6 * std::hypot(1.0, 0.4) * std::pow(2.0 * pi / 400.0, 2);
  std::cout << at_points << " mm at points, " << between << " mm between, bound "
            << 100.0 / 8.0 * bend << " mm\n";
  EXPECT_EQ(at_points, 0.0) << "every bit is written";
  EXPECT_LE(between, 100.0 / 8.0 * bend);
}

TEST(Isg, SaysWhatItCannotHold) {
  const Chain chain = gantry();
  GeometricErrors errors = believed_waves();
  errors.elements[1].curves.push_back({errors::Backlash{1e-3}});
  errors.elements[3].curves.push_back({errors::Repeatability{1e-3, 5}});
  errors.elements.push_back({errors::parse_element_name("EXS"), {{Constant{1e-3}}}});
  const ControlExport made = to_volumetric(errors::bind(errors, chain), chain);
  for (const std::string& sentence : made.omissions) std::cout << sentence << "\n";
  EXPECT_TRUE(says(made.omissions, "X: dependence on direction"));
  EXPECT_TRUE(says(made.omissions, "EZY: its random part"));
  EXPECT_TRUE(says(made.omissions, "EXS: not an axis of the format"));
  EXPECT_EQ(made.omissions.size(), 3u);
}

TEST(Isg, HoldsDeviationsAndNoCorrections) {
  EXPECT_THROW(to_control(none(), gantry(), ControlFormat::Isg), std::invalid_argument);
  EXPECT_THROW(read_control_tables({}, gantry(), ControlFormat::Isg), std::invalid_argument);
}

TEST(Isg, RefusesByLineAndColumn) {
  const auto at = [](const std::string& from, const std::string& to) {
    return refusal([&] { volumetric_errors(with(example, from, to)); });
  };
  EXPECT_EQ(at("X ", "X "), Place{});
  EXPECT_EQ(at("X      EXX", "Z      X"), (Place{2, 8})) << "two arguments";
  EXPECT_EQ(at("X      EXX", "B      EXX"), (Place{2, 8}));
  EXPECT_EQ(at("X      EXX    EYX    EZX    EAX    EBX    ECX",
               "B      EXB    EYB    EZB    EAB    EBB    ECB"),
            (Place{2, 1}));
  EXPECT_EQ(at("-0.1", "-0.1.1"), (Place{4, 15}));
  EXPECT_EQ(at("10.0", "0.0"), (Place{4, 1}));
  EXPECT_EQ(at("0.002", "     "), (Place{4, 50}));
  EXPECT_EQ(at("C0Y    A0Z", "C0Y    EAZ"), (Place{7, 8}));
  EXPECT_EQ(at("C0Y    A0Z", "C0Y    C0Y"), Place{}) << "the second is zero";
  EXPECT_EQ(at("X0C", "C0Y"), (Place{8, 15}));
  EXPECT_EQ(at("X0C", "C0C"), (Place{8, 15})) << "an axis has no squareness about itself";
  EXPECT_EQ(at("X0C", "X0B"), (Place{7, 15}));
  EXPECT_EQ(at("0.1    0      0.11\n", "0.1    0\n"), (Place{8, 1}));
  EXPECT_EQ(at("0.1    0      0.11\n", "").line, 7);
  EXPECT_EQ(at("0.11\n", "0.11\n1 2 3\n"), (Place{9, 1}));
  EXPECT_EQ(at("// the last row\n", "\n#\nX EYX\n0 0\n1 0\n"), (Place{6, 1})) << "EYX twice";
  std::string heads;
  for (int k = 0; k < 100; ++k) heads += "#\n";
  EXPECT_EQ(refusal([&] { volumetric_errors(heads); }), (Place{64, 1}));
  EXPECT_TRUE(volumetric_errors("").elements.empty());
  EXPECT_TRUE(volumetric_errors("\xEF\xBB\xBF\xEF\xBB\xBF// nothing\n").elements.empty());
}

ParameterTables siemens_tables(const std::string& text) {
  return read_control_tables(std::vector<ControlFile>{{"A.INI", text}}, gantry(),
                             ControlFormat::Siemens);
}

// laid out as the example of the function manual
const std::string encoder_ini =
    "%_N_AX_EEC_INI\n"
    "CHANDATA(1)\n"
    "$AA_ENC_COMP[0,0,X1]=0.003   ; 1st value: +3 um\n"
    "$AA_ENC_COMP[0,1,X1]=0.01\n"
    "$AA_ENC_COMP[0,2,X1]=-0.0\n"
    "$AA_ENC_COMP_STEP[0,X1]=100.0\n"
    "$AA_ENC_COMP_MIN[0,X1]=-50.0\n"
    "$AA_ENC_COMP_MAX[0,X1]=150.0\n"
    "$AA_ENC_COMP_IS_MODULO[0,X1]=0\n"
    "M17\n";

const std::string cross_ini =
    "%_N_NC_CEC_INI\r\n"
    "CHANDATA(1)\r\n"
    "$AN_CEC[3,0] = 0\r\n"
    "$AN_CEC[3,1] = 0.01\r\n"
    "$AN_CEC_INPUT_AXIS[3]=(Y1)\r\n"
    "$AN_CEC_OUTPUT_AXIS[3]=(Z1)\r\n"
    "$AN_CEC_STEP[3]=800.0\r\n"
    "$AN_CEC_MIN[3]=-400.0\r\n"
    "$AN_CEC_MAX[3]=400.0\r\n"
    "$AN_CEC_DIRECTION[3]=1\r\n"
    "$AN_CEC_MULT_BY_TABLE[3]=0\r\n"
    "$AN_CEC_IS_MODULO[3]=0\r\n"
    "M17\r\n";

TEST(Siemens, APositiveEncoderValueMovesTheAxisInTheNegativeDirection) {
  const ParameterTables tables = siemens_tables(encoder_ini);
  ASSERT_EQ(tables.tables.size(), 1u);
  const AxisTable& table = tables.tables[0];
  EXPECT_EQ(table.argument_joint, X);
  EXPECT_EQ(table.corrected_joint, X);
  EXPECT_EQ(table.position, Vector3d(-50, 50, 150));
  EXPECT_EQ(table.upward, Vector3d(-0.003, -0.01, 0.0));
  EXPECT_EQ(table.downward, table.upward);
  EXPECT_EQ(correction(table, -1000, 1), -0.003) << "the first value holds beyond";
}

TEST(Siemens, ATableOfOneDirectionIsForThatDirectionOnly) {
  const ParameterTables tables = siemens_tables(cross_ini);
  ASSERT_EQ(tables.tables.size(), 1u);
  EXPECT_EQ(tables.tables[0].argument_joint, Y);
  EXPECT_EQ(tables.tables[0].corrected_joint, Z);
  EXPECT_EQ(tables.tables[0].upward, Vector2d(0, 0.01));
  EXPECT_EQ(tables.tables[0].downward, Vector2d(0, 0));
}

TEST(Siemens, OwnTablesAlikeBothWaysGoToTheEncoderAllOthersToTheCrossTables) {
  ParameterTables tables = none();
  const Vector3d p(-100, 0, 100), v(1e-3, 2e-3, -3e-3), w(0, 1e-3, 0);
  tables.tables = {{X, X, p, v, v}, {Y, Y, p, v, w}, {X, Z, p, v, v}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Siemens);
  ASSERT_EQ(made.files.size(), 2u);
  EXPECT_EQ(file(made, "AX_EEC.INI").text,
            "%_N_AX_EEC_INI\nCHANDATA(1)\n"
            "$AA_ENC_COMP[0,0,X1]=-0.00100000\n"
            "$AA_ENC_COMP[0,1,X1]=-0.00200000\n"
            "$AA_ENC_COMP[0,2,X1]=0.00300000\n"
            "$AA_ENC_COMP_STEP[0,X1]=100.000000000000\n"
            "$AA_ENC_COMP_MIN[0,X1]=-100.00000000\n"
            "$AA_ENC_COMP_MAX[0,X1]=100.00000000\n"
            "$AA_ENC_COMP_IS_MODULO[0,X1]=0\n"
            "M17\n");
  const std::string& text = file(made, "NC_CEC.INI").text;
  for (const char* line :
       {"$AN_CEC_INPUT_AXIS[0]=(Y1)\n", "$AN_CEC_DIRECTION[0]=1\n", "$AN_CEC_DIRECTION[1]=-1\n",
        "$AN_CEC[0,2]=-0.00300000\n", "$AN_CEC[1,1]=0.00100000\n", "$AN_CEC_OUTPUT_AXIS[2]=(Z1)\n",
        "$AN_CEC_DIRECTION[2]=0\n"})
    EXPECT_TRUE(says({text}, line)) << line;
  EXPECT_TRUE(text.ends_with("M17\n"));
  EXPECT_TRUE(says(made.notes, "assumed"));
}

TEST(Siemens, PointsThatAreNotEquidistantAreReadOff) {
  ParameterTables tables = none();
  tables.offset[X] = 1e-3;
  const Vector3d p(0, 10, 40), v(0, 4e-3, 4e-3);
  tables.tables = {{X, X, p, v, v}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Siemens);
  for (const std::string& sentence : made.omissions) std::cout << sentence << "\n";
  EXPECT_TRUE(says(made.omissions,
                   "X: 3 points that are not equidistant; equidistant points deviate by 2 um"));
  EXPECT_TRUE(says(made.omissions, "offset of X, 1 um"));
  const ParameterTables back = read_control_tables(made.files, gantry(), ControlFormat::Siemens);
  EXPECT_EQ(back.tables.at(0).position, Vector3d(0, 20, 40));
}

TEST(Siemens, RandomTablesComeBack) {
  SeededRandom random(20250703);
  const Chain chain = gantry();
  Difference largest;
  for (int run = 0; run < 100; ++run) {
    const ParameterTables tables = any_tables(chain, random, {true, run % 2 == 0, true, 400});
    const ControlExport made = to_control(tables, chain, ControlFormat::Siemens);
    EXPECT_TRUE(made.omissions.empty());
    const ParameterTables back = read_control_tables(made.files, chain, ControlFormat::Siemens);
    EXPECT_EQ(back.tables.size(), tables.tables.size()) << "each pair of directions is one again";
    const Difference d = difference(tables, back, chain, random);
    largest.mm = std::max(largest.mm, d.mm);
    largest.rad = std::max(largest.rad, d.rad);
  }
  std::cout << largest.mm << " mm, " << largest.rad << " rad\n";
  // four tables move an axis; half a digit each, and the last points of a rotary axis
  EXPECT_LT(largest.mm, 4 * 0.55e-8);
  EXPECT_LT(largest.rad, 4 * 0.55e-8 * units::deg);
}

TEST(Siemens, ASecondProgramMayNotWriteTheSameTable) {
  const auto both = [](const std::string& one, const std::string& two) {
    return refusal([&] {
      read_control_tables(std::vector<ControlFile>{{"A.INI", one}, {"B.INI", two}}, gantry(),
                          ControlFormat::Siemens);
    });
  };
  EXPECT_EQ(both(encoder_ini, cross_ini), Place{});
  EXPECT_EQ(both(encoder_ini, encoder_ini), (Place{3, 1}));
  EXPECT_EQ(both(cross_ini, cross_ini), (Place{3, 1}));
}

TEST(Siemens, RefusesByLineAndColumn) {
  const auto of_encoder = [](const std::string& from, const std::string& to) {
    return refusal([&] { siemens_tables(with(encoder_ini, from, to)); });
  };
  EXPECT_EQ(of_encoder("M17", "M17"), Place{});
  EXPECT_EQ(of_encoder("M17", "M30"), (Place{10, 1}));
  EXPECT_EQ(of_encoder("M17\n", "").line, 9);
  EXPECT_EQ(of_encoder("M17\n", "M17\n\n R1=2"), (Place{12, 2}));
  EXPECT_EQ(of_encoder("CHANDATA(1)", "G0 X0"), (Place{2, 1}));
  EXPECT_EQ(of_encoder("0.003", "0,003"), (Place{3, 22}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[1,1,X1]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[]"), (Place{4, 14}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,5000,X1]"), (Place{4, 16}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,0,X1]"), (Place{4, 16}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,AX1]"), (Place{4, 18}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,B1]"), (Place{4, 18}));
  EXPECT_EQ(of_encoder("[0,1,X1]", "[0,1,X1"), (Place{4, 1}));
  EXPECT_EQ(of_encoder("[0,1,X1]=", "[0,1,X1] x ="), (Place{4, 22}));
  EXPECT_EQ(of_encoder("_COMP_MIN", "_COMP_MUN"), (Place{7, 1}));
  EXPECT_EQ(of_encoder("$AA_ENC_COMP_MIN", "$MN_MIN"), (Place{7, 1}));
  EXPECT_EQ(of_encoder("=150.0", "="), (Place{8, 24}));
  EXPECT_EQ(of_encoder("MODULO[0,X1]=0", "MODULO[0,X1]=1"), (Place{9, 30}));
  EXPECT_EQ(of_encoder("M17", "$AA_ENC_COMP_MIN[0,X1]=0\nM17"), (Place{10, 24}));
  for (const auto& [from, to] :
       std::vector<std::pair<std::string, std::string>>{{"=100.0", "=0"},
                                                        {"=100.0", "=-100"},
                                                        {"=100.0", "=90.0"},
                                                        {"=100.0", "=1e-5"},
                                                        {"=100.0", "=50"},
                                                        {"=-50.0", "=150.0"},
                                                        {"$AA_ENC_COMP_STEP[0,X1]=100.0\n", ""},
                                                        {"$AA_ENC_COMP[0,1,X1]=0.01\n", ""},
                                                        {"$AA_ENC_COMP[0,2,X1]=-0.0\n", ""}})
    EXPECT_EQ(of_encoder(from, to), (Place{3, 1})) << from << " -> " << to;
  const auto of_cross = [](const std::string& from, const std::string& to) {
    return refusal([&] { siemens_tables(with(cross_ini, from, to)); });
  };
  EXPECT_EQ(of_cross("[3,0]", "[3,0]"), Place{});
  EXPECT_EQ(of_cross("[3,0]", "[3.0]"), (Place{3, 9})) << "one index";
  EXPECT_EQ(of_cross("[3,0]", "[200,0]"), (Place{3, 9}));
  EXPECT_EQ(of_cross("(Y1)", "Y1"), (Place{5, 23}));
  EXPECT_EQ(of_cross("(Y1)", "(Y1"), (Place{5, 23}));
  EXPECT_EQ(of_cross("(Y1)", "(S1)"), (Place{5, 24}));
  EXPECT_EQ(of_cross("DIRECTION[3]=1", "DIRECTION[3]=2"), (Place{10, 22}));
  EXPECT_EQ(of_cross("TABLE[3]=0", "TABLE[3]=1"), (Place{11, 26})) << "products are not followed";
  EXPECT_EQ(of_cross("$AN_CEC_OUTPUT_AXIS[3]=(Z1)\r\n", ""), (Place{3, 1}));
  EXPECT_EQ(of_cross("STEP[3]=800", "STEP[3]=1e-9 ;"), (Place{3, 1}));
}

ParameterTables heidenhain_tables(const std::vector<ControlFile>& files) {
  return read_control_tables(files, gantry(), ControlFormat::Heidenhain);
}

const std::string com =
    "BEGIN Y.COM MM\n"
    "NR    AXISPOS   Y         BACKLASH  Z\n"
    "0     -90       0.01      0.02      0\n"
    "1     10.5      -0.03     0         0.04\n"
    "[END]\n";

const std::string cma =
    "BEGIN CONFIG.CMA MM\n"
    "NR    X         Y         ACTIVE\n"
    "0     other.com\n"
    "1               y.com     *\n"
    "[END]\n";

TEST(Heidenhain, ColumnsHoldErrorsThatTheControlTakesOff) {
  const ParameterTables tables = heidenhain_tables({{"Y.COM", com}, {"CONFIG.CMA", cma}});
  ASSERT_EQ(tables.tables.size(), 2u);
  const AxisTable& own = tables.tables[0];
  EXPECT_EQ(own.argument_joint, Y);
  EXPECT_EQ(own.corrected_joint, Y);
  EXPECT_EQ(own.position, Vector2d(-90, 10.5));
  EXPECT_EQ(own.upward, Vector2d(-0.01, 0.03));
  EXPECT_EQ(own.downward, Vector2d(-0.02, 0));
  const AxisTable& sag = tables.tables[1];
  EXPECT_EQ(sag.argument_joint, Y);
  EXPECT_EQ(sag.corrected_joint, Z);
  EXPECT_EQ(sag.upward, Vector2d(0, -0.04));
  EXPECT_EQ(sag.downward, sag.upward);
}

TEST(Heidenhain, WritesATableForEachAxisThatIsLookedUpAndTheLineInForce) {
  ParameterTables tables = none();
  const Vector2d p(-90, 10), v(-1e-3, 2e-3), w(-3e-3, 0);
  tables.tables = {
      {Y, Y, p, v, w}, {Y, Z, p, v, w}, {A, A, p * units::deg, v * units::deg, v * units::deg}};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Heidenhain);
  EXPECT_EQ(file(made, "Y.COM").text,
            "BEGIN Y.COM MM\n"
            "NR            AXISPOS       Y             Z             BACKLASH\n"
            "0             -90.0000      0.0010        0.0020        0.0030\n"
            "1             10.0000       -0.0020       -0.0010       0.0000\n"
            "[END]\n");
  EXPECT_EQ(file(made, "CONFIG.CMA").text,
            "BEGIN CONFIG.CMA MM\n"
            "NR            Y             A             ACTIVE\n"
            "0             Y.COM         A.COM         *\n"
            "[END]\n");
  EXPECT_TRUE(says({file(made, "A.COM").text}, "-90.0000      0.0010"));
  EXPECT_TRUE(says(made.omissions, "Z over Y: dependence on direction"));
  EXPECT_EQ(made.omissions.size(), 1u);
  EXPECT_TRUE(says(made.notes, "assumed"));
}

TEST(Heidenhain, RandomTablesComeBackToItsDigits) {
  SeededRandom random(20250704);
  const Chain chain = gantry();
  Difference largest;
  for (int run = 0; run < 100; ++run) {
    ParameterTables tables = any_tables(chain, random, {run % 2 == 0, true, run % 2 == 0, 15});
    for (AxisTable& table : tables.tables)
      if (table.argument_joint != table.corrected_joint) table.downward = table.upward;
    const ControlExport made = to_control(tables, chain, ControlFormat::Heidenhain);
    EXPECT_TRUE(made.omissions.empty());
    const Difference d = difference(tables, heidenhain_tables(made.files), chain, random);
    largest.mm = std::max(largest.mm, d.mm);
    largest.rad = std::max(largest.rad, d.rad);
  }
  std::cout << largest.mm << " mm, " << largest.rad << " rad\n";
  // four tables an axis, half a digit each, and half a digit of position on a steep piece
  EXPECT_LT(largest.mm, 4 * 0.6e-4);
  EXPECT_LT(largest.rad, 4 * 0.6e-4 * units::deg);
}

TEST(Heidenhain, MoreThan256RowsAreReadOffAndSaid) {
  ParameterTables tables = none();
  AxisTable table{X, X, VectorXd::LinSpaced(300, -300, 300), {}, {}};
  table.upward = table.downward = table.position.array().sin() * 1e-3;
  tables.tables = {table};
  const ControlExport made = to_control(tables, gantry(), ControlFormat::Heidenhain);
  EXPECT_TRUE(says(made.omissions, "X: 300 points, but the control holds only 256"));
  EXPECT_EQ(heidenhain_tables(made.files).tables.at(0).position.size(), 256);
}

TEST(Heidenhain, RefusesByLineAndColumn) {
  const auto of_com = [](const std::string& from, const std::string& to) {
    return refusal([&] { heidenhain_tables({{"Y.COM", with(com, from, to)}}); });
  };
  EXPECT_EQ(of_com("NR", "NR"), Place{});
  EXPECT_EQ(of_com("BEGIN", "START"), (Place{1, 1}));
  EXPECT_EQ(of_com(" MM", " INCH"), (Place{1, 13}));
  EXPECT_EQ(of_com("NR", "N "), (Place{2, 1}));
  EXPECT_EQ(of_com("BACKLASH", "BOCKLASH"), (Place{2, 27}));
  EXPECT_EQ(of_com("AXISPOS", "X      "), (Place{2, 1}));
  EXPECT_EQ(of_com("AXISPOS   Y", "AXISPOS   X"), (Place{2, 27})) << "BACKLASH of what?";
  EXPECT_EQ(of_com("BACKLASH  Z", "BACKLASH  Y"), (Place{2, 37}));
  EXPECT_EQ(of_com("-0.03", "-O.03"), (Place{4, 17}));
  EXPECT_EQ(of_com("1     10.5", "2     10.5"), (Place{4, 1}));
  EXPECT_EQ(of_com("1     10.5", "1     -99 "), (Place{4, 7}));
  EXPECT_EQ(of_com("0.02      0", "0.02"), (Place{3, 37}));
  EXPECT_EQ(of_com("[END]\n", "").line, 4);
  EXPECT_EQ(of_com("[END]\n", "[END]\nx"), (Place{6, 1}));
  EXPECT_EQ(of_com("1     10.5      -0.03     0         0.04\n", "").line, 4) << "one row";
  EXPECT_EQ(refusal([] { heidenhain_tables({{"pitch.com", com}}); }), (Place{0, 0}));
  EXPECT_EQ(refusal([] { heidenhain_tables({{"Y.COM", ""}}); }).line, 0);
  const auto of_cma = [](const std::string& from, const std::string& to) {
    return refusal([&] { heidenhain_tables({{"Y.COM", com}, {"C.CMA", with(cma, from, to)}}); });
  };
  EXPECT_EQ(of_cma("NR", "NR"), Place{});
  EXPECT_EQ(of_cma("y.com", "z.com"), (Place{4, 17}));
  EXPECT_EQ(of_cma("other.com\n", "other.com           *\n"), (Place{4, 27}));
  EXPECT_EQ(of_cma("*", "+"), (Place{4, 27}));
  EXPECT_EQ(of_cma("*", "").line, 5);
  EXPECT_EQ(of_cma("ACTIVE", "ACTIVO"), (Place{2, 27}));
  EXPECT_EQ(of_cma("     ACTIVE", ""), (Place{2, 1}));
  EXPECT_EQ(of_cma("X  ", "s  "), (Place{2, 7}));
}

}  // namespace
}  // namespace abbe::sim::compensation
