#include "sim/scene/read_scene.h"
#include "sim/scene/toml.h"
#include "sim/study/configuration.h"
#include "sim/study/study.h"
#include "tests/injured.h"
#include "tests/sim/refusal.h"
#include "tests/study/small_study.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

/// Three inputs of three kinds on lines 2, 5 and 8.
const std::string three_inputs =
    "scene = \"scene.toml\"\n"
    "[[input]]\nelement = \"EXX\"\nspread = 0.5\n"
    "[[input]]\npath = \"setup.EX_um\"\nspread = 3\n"
    "[[input]]\nnumber = \"EYX[2]\"\nspread = 2\n";

class ReadStudy : public testing::Test {
 protected:
  Study read(const std::string& text, const std::vector<Override>& overrides = {}) const {
    return read_study(folder_.write("study.toml", text), overrides);
  }
  std::string refusal(const std::string& text, const std::vector<Override>& overrides = {}) const {
    return refusal_by([&] { read(text, overrides); });
  }
  /// Refused at that line and column, in words that hold all of these.
  void expect_refused(const std::string& text, const std::string& place,
                      const std::vector<std::string>& words) const {
    const std::string said = refusal(text);
    EXPECT_HAS(said, "study.toml:" + place + ":") << "wanted " << place;
    for (const std::string& word : words) EXPECT_HAS(said, word);
  }

  StudyFolder folder_;
};

// ---------------------------------------------------------------- what is read

TEST_F(ReadStudy, OfLittleTextHasTheDefaults) {
  const Study study = read(three_inputs);
  EXPECT_EQ(study.title, "study");
  EXPECT_EQ(study.engine, Engine::Influence);
  EXPECT_EQ(study.seed, 1u);
  EXPECT_EQ(study.verification_cases, 50u);
  ASSERT_EQ(study.configurations.size(), 1u);
  EXPECT_EQ(study.configurations[0].name, "uncompensated");
  EXPECT_EQ(study.responses, (std::vector{Response::Pv, Response::Rms}));
  EXPECT_FALSE(study.subtracts_error_free_map || study.one_at_a_time || study.monte_carlo ||
               study.sobol || study.worst_case || study.tolerance || study.uncertainty ||
               study.histories);
  EXPECT_TRUE(study.sweeps.empty() && study.limits.empty() && study.copula.groups().empty());
  EXPECT_EQ(study.influence.reach, 0.05);
  EXPECT_EQ(study.influence.flag_threshold, 2e-4);
}

TEST_F(ReadStudy, EveryKeyArrives) {
  const Study study = read(
      "title = \"all\"\nscene = \"scene.toml\"\nengine = \"both\"\nseed = 7\nproofs = 5\n"
      "set = { part.vertices = 400 }\n"
      "cases = [\"uncompensated\", \"perfect-iterated-ideal\"]\nvariants = [\"\", \"leaning\"]\n"
      "responses = [\"p95_abs\", \"in_tolerance\", \"mean\", \"std\", \"max_abs\", \"rms\", "
      "\"form_pv\", \"form_rms\", \"texture_sa\", \"texture_sq\", \"texture_sz\"]\n"
      "of = \"machine\"\nlimits = { rms_um = 4, p95_abs_um = 30, form_pv_um = 8, texture_sz_um = 2 "
      "}\n"
      "[[input]]\nelement = \"EXX\"\nname = \"scale of X\"\nspread = 0.5\nlow = 0.1\nhigh = 3\n"
      "[[input]]\npath = [\"setup.EX_um\", \"setup.EY_um\"]\nfactor = -2\nspread = 3\n"
      "distribution = \"uniform\"\ncost = 4\n"
      "[[input]]\nnumber = \"EAX[2]\"\nspread = 0.3\ncentre = 2\ndistribution = \"log_normal\"\n"
      "[[correlation]]\nfirst = \"scale of X\"\nsecond = \"setup.EX_um\"\nrho = -0.5\n"
      "[one_at_a_time]\nstep = 2\n[monte_carlo]\ncases = 30\nsampling = \"random\"\n"
      "[[sweep]]\ninput = \"EAX[2]\"\nvalues = [1, 2, 4]\n"
      "[[sweep]]\ninput = \"setup.EX_um\"\nfrom = -1\nto = 1\nsteps = 5\n"
      "[worst_case]\ncoverage = 2\n"
      "[tolerance]\nresponse = \"rms\"\nlimit_um = 12\nconfidence = 0.9\nmachines = 300\n"
      "[uncertainty]\nconfidence = 0.8\nmachines = 500\n"
      "[influence]\nreach_um = 70\nmost_rivals = 3\nchecks = 1\nflag_um = 0.5\nsheet = false\n"
      "pictures = [\"scale of X\"]\n");
  EXPECT_EQ(study.title, "all");
  EXPECT_EQ(study.engine, Engine::Both);
  EXPECT_EQ(study.seed, 7u);
  EXPECT_EQ(study.verification_cases, 5u);
  EXPECT_EQ(study.overrides, (std::vector<Override>{{"part.vertices", "400"}}));
  ASSERT_EQ(study.configurations.size(), 4u);
  EXPECT_EQ(study.configurations[0].name, "uncompensated");
  EXPECT_EQ(study.configurations[1].name, "perfect-iterated-ideal");
  EXPECT_EQ(study.configurations[3].name, "leaning perfect-iterated-ideal");
  EXPECT_EQ(study.configurations[3].variant, "leaning");
  EXPECT_EQ(study.responses.size(), 11u);
  EXPECT_TRUE(study.subtracts_error_free_map);
  EXPECT_EQ(study.limits, (std::vector<std::pair<Response, double>>{{Response::Rms, 0.004},
                                                                    {Response::P95Abs, 0.03},
                                                                    {Response::FormPv, 0.008},
                                                                    {Response::TextureSz, 0.002}}));
  ASSERT_EQ(study.inputs.size(), 3u);
  EXPECT_EQ(study.inputs[0].name, "scale of X");
  EXPECT_EQ(study.inputs[0].element, "EXX");
  EXPECT_EQ(study.inputs[0].unit, "");
  EXPECT_EQ(study.inputs[0].distribution.centre, 1.0);
  EXPECT_EQ(study.inputs[0].distribution.low, 0.1);
  EXPECT_EQ(study.inputs[0].distribution.high, 3.0);
  EXPECT_EQ(study.inputs[1].name, "setup.EX_um");
  EXPECT_EQ(study.inputs[1].unit, "um");
  EXPECT_EQ(study.inputs[1].settings.size(), 2u);
  EXPECT_EQ(study.inputs[1].settings[1].factor, -2.0);
  EXPECT_EQ(study.inputs[1].cost, 4.0);
  EXPECT_EQ(study.inputs[1].distribution.kind, Distribution::Kind::Uniform);
  EXPECT_EQ(study.inputs[2].unit, "urad");
  EXPECT_EQ(study.inputs[2].distribution.kind, Distribution::Kind::LogNormal);
  ASSERT_EQ(study.copula.groups().size(), 1u);
  EXPECT_EQ(study.copula.groups()[0].of, (std::vector{0, 1}));
  EXPECT_EQ(study.one_at_a_time->step, 2.0);
  EXPECT_EQ(study.monte_carlo->cases, 30u);
  EXPECT_EQ(study.monte_carlo->sampling, Sampling::Random);
  ASSERT_EQ(study.sweeps.size(), 2u);
  EXPECT_EQ(study.sweeps[0].input, 2);
  EXPECT_EQ(study.sweeps[0].values, Vector3d(1, 2, 4));
  EXPECT_EQ(study.sweeps[1].input, 1);
  EXPECT_EQ(study.sweeps[1].values.size(), 5);
  EXPECT_EQ(study.sweeps[1].values[1], -0.5);
  EXPECT_EQ(study.worst_case->coverage, 2.0);
  EXPECT_EQ(study.tolerance->response, Response::Rms);
  EXPECT_DOUBLE_EQ(study.tolerance->limit, 0.012);
  EXPECT_EQ(study.tolerance->confidence, 0.9);
  EXPECT_EQ(study.tolerance->machines, 300u);
  EXPECT_EQ(study.uncertainty->confidence, 0.8);
  EXPECT_EQ(study.uncertainty->machines, 500u);
  EXPECT_DOUBLE_EQ(study.influence.reach, 0.07);
  EXPECT_EQ(study.influence.max_competing_passes, 3);
  EXPECT_EQ(study.influence.checks, 1);
  EXPECT_DOUBLE_EQ(study.influence.flag_threshold, 5e-4);
  EXPECT_FALSE(study.influence.has_overview_sheet);
  EXPECT_EQ(study.influence.pictures, (std::vector<std::string>{"scale of X"}));
}

TEST_F(ReadStudy, InputsActOnTheSceneAsWritten) {
  const Study study = read(
      "scene = \"scene.toml\"\n"
      "[[input]]\nelement = \"EXX\"\nspread = 0.5\n"
      "[[input]]\npath = [\"setup.EX_um\", \"setup.EY_um\"]\nfactor = -2\nspread = 3\n"
      "[[input]]\nnumber = \"EYX[2]\"\nspread = 2\n");
  const Scene base = base_scene(study, study.configurations[0]);
  const Scene at = scene_at(study, study.configurations[0], base, Vector3d(3.0, 5.0, 7.0));
  EXPECT_DOUBLE_EQ(at.setup[0], -0.010);
  EXPECT_DOUBLE_EQ(at.setup[1], -0.010);
  const auto element = [](const Scene& scene, const std::string& name) {
    for (const errors::Element& one : scene.geometric.elements)
      if (errors::to_string(one.name) == name) return one;
    ADD_FAILURE() << name;
    return errors::Element{};
  };
  for (std::size_t k = 0; k < element(base, "EXX").curves.size(); ++k)
    EXPECT_DOUBLE_EQ(element(at, "EXX").curves[k].scale,
                     3.0 * element(base, "EXX").curves[k].scale);
  EXPECT_EQ(element(at, "EAX").curves[0].scale, element(base, "EAX").curves[0].scale);
  EXPECT_EQ(scene_at(study, study.configurations[0], base, Vector3d(3.0, 5.0, 7.0)).resolved,
            at.resolved);
}

TEST_F(ReadStudy, WholeNumbersReachKeysThatTakeNoOthers) {
  const Study study = read(
      "scene = \"scene.toml\"\nengine = \"full\"\n"
      "[[input]]\npath = \"part.vertices\"\ncentre = 300\nspread = 50\n");
  const Scene base = base_scene(study, study.configurations[0]);
  EXPECT_EQ(
      scene_at(study, study.configurations[0], base, VectorXd::Constant(1, 450.0)).part.vertices,
      450);
  EXPECT_NE(refusal_by([&] {
              scene_at(study, study.configurations[0], base, VectorXd::Constant(1, 450.5));
            }),
            "");
}

TEST_F(ReadStudy, ManyInputsComeFromElementsAndNumbers) {
  const Study elements = read("scene = \"scene.toml\"\n[[inputs]]\nevery = \"element\"\n");
  EXPECT_EQ(elements.inputs.size(), 46u);
  const Study two = read(
      "scene = \"scene.toml\"\n[[inputs]]\nevery = \"number\"\nof = [\"EXX\", \"EC0Y\"]\n"
      "centre = 1\nspread = 0.1\nlow = 0.5\ncost = 3\n");
  bool square = false;
  for (const Input& input : two.inputs) {
    EXPECT_TRUE(input.number.starts_with("EXX") || input.number.starts_with("EC0Y"))
        << input.number;
    EXPECT_EQ(input.cost, 3.0);
    const Distribution& d = input.distribution;
    EXPECT_NEAR(d.spread, 0.1 * std::abs(d.centre), 1e-12) << "in multiples of the number";
    EXPECT_EQ(d.centre > 0.0 ? d.low : d.high, 0.5 * d.centre) << "whatever its sign";
    if (!input.number.starts_with("EC0Y")) continue;
    square = true;
    EXPECT_NEAR(d.centre, 32.0, 1e-12) << "EC0Y_urad of the scene";
    EXPECT_EQ(input.unit, "urad");
  }
  EXPECT_TRUE(square);
}

TEST_F(ReadStudy, OverridesOfTheStudyWin) {
  const Study study =
      read(three_inputs + "[monte_carlo]\ncases = 10\n",
           {{"monte_carlo.cases", "20"}, {"engine", "full"}, {"input.0.spread", "0.25"}});
  EXPECT_EQ(study.monte_carlo->cases, 20u);
  EXPECT_EQ(study.engine, Engine::Full);
  EXPECT_EQ(study.inputs[0].distribution.spread, 0.25);
  for (const Override& bad : std::vector<Override>{{"monte_carlo.cases", "-3"},
                                                   {"monte_carlo.cses", "3"},
                                                   {"engine", "steam"},
                                                   {"input.9.spread", "1"},
                                                   {"", "1"},
                                                   {"..", "1"},
                                                   {"seed", "\n"}})
    EXPECT_NE(refusal(three_inputs + "[monte_carlo]\n", {bad}), "") << bad.path;
}

TEST_F(ReadStudy, TheTextThatItKeepsReadsToTheSameStudy) {
  const Study study = read(three_inputs + "[one_at_a_time]\n[monte_carlo]\ncases = 12\n");
  const RunFolder elsewhere;
  const Study again = read_study(elsewhere.write("study.toml", study.text));
  EXPECT_EQ(again.text, study.text);
  EXPECT_EQ(again.identity, study.identity);
}

TEST_F(ReadStudy, AnyChangeOfStudySceneOrItsFilesIsAnotherIdentity) {
  const std::string text = three_inputs + "[monte_carlo]\ncases = 12\n";
  const std::string identity = read(text).identity;
  EXPECT_EQ(read(text).identity, identity);
  EXPECT_EQ(read("# a remark\n" + text).identity, identity);
  EXPECT_NE(read(text, {{"seed", "2"}}).identity, identity);
  EXPECT_NE(read(text, {{"set", "{ part.vertices = 301 }"}}).identity, identity);
  folder_.write("scene.toml", with(small_scene(), "vertices = 300", "vertices = 301"));
  EXPECT_NE(read(text).identity, identity) << "another scene under the old name";
  const auto with_program = [&](const std::string& last) {
    folder_.write("p.ngc",
                  "G21 G90 G94 G17\nG54\nG43.4 H1\nG0 X0 Y0 Z95 A0 C0\n" + last + "\nM2\n");
    const std::string scene = small_scene();
    const std::size_t from = scene.find("[program]"), to = scene.find("[sampling]");
    folder_.write("scene.toml",
                  scene.substr(0, from) + "[program]\nfile = \"p.ngc\"\n" + scene.substr(to));
    return read(text).identity;
  };
  EXPECT_NE(with_program("G1 X1 F100"), with_program("G1 X2 F100"))
      << "another program under the old name";
  const auto with_paint = [&](const std::string& kd) {
    folder_.write("b.mtl", "newmtl paint\nKd " + kd + "\n");
    folder_.write("b.obj",
                  "mtllib b.mtl\nusemtl paint\nv 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 "
                  "2 4\nf 2 3 4\nf 1 4 3\n");
    std::string scene = with(small_scene(), "overrun_mm = 1.0\n", "");
    scene =
        with(scene, "vertices = 300\n", "[[part.region]]\nname = \"a\"\ncolour = \"#ff0000\"\n");
    scene = with(scene, "surface = \"sphere_cap\"\nradius_mm = 20\nrim_radius_mm = 6\n",
                 "file = \"b.obj\"\n");
    folder_.write("scene.toml", scene);
    return read(text).identity;
  };
  EXPECT_NE(with_paint("1 0 0"), with_paint("0 1 0")) << "no key names the materials of an OBJ";
}

// ---------------------------------------------------------------- what is refused, and where

TEST_F(ReadStudy, RefusesAtThePlaceOfTheFault) {
  const struct {
    std::string more, place;
    std::vector<std::string> words;
  } cases[] = {
      {"[one_at_a_tme]\n", "11:2", {"one_at_a_time", "one_at_a_tme"}},
      {"[one_at_a_time]\nstp = 1\n", "12:1", {"one_at_a_time.step", "stp"}},
      {"[one_at_a_time]\nstep = 0\n", "12:8", {"step", "0"}},
      {"[one_at_a_time]\nstep = nan\n", "12:8", {"finite", "nan"}},
      {"[one_at_a_time]\nstep = inf\n", "12:8", {"finite", "inf"}},
      {"[one_at_a_time]\nstep = \"1\"\n", "12:8", {"a number"}},
      {"[monte_carlo]\ncases = 1\n", "12:9", {"an integer from 2 to"}},
      {"[monte_carlo]\ncases = 1000000000000\n", "12:9", {"an integer from 2 to"}},
      {"[monte_carlo]\ncases = 9223372036854775807\n", "12:9", {"an integer from 2 to"}},
      {"[monte_carlo]\ncases = 10.5\n", "12:9", {"an integer"}},
      {"[monte_carlo]\nsampling = \"sobl\"\n", "12:12", {"random", "nearest: \"sobol\""}},
      {"[monte_carlo]\nsampling = 1\n", "12:12", {"sobol"}},
      {"[sobol_indices]\nbase_points = 7\n", "12:15", {"8"}},
      {"[sobol_indices]\nbase_points = 16777216\n", "1:1", {"cases in all", "83886081"}},
      {"[[sweep]]\ninput = \"EXY\"\nfrom = 0\nto = 1\n", "12:9", {"nearest: \"EXX\""}},
      {"[[sweep]]\nfrom = 0\nto = 1\n", "11:1", {"input"}},
      {"[[sweep]]\ninput = \"EXX\"\nvalues = []\n", "13:10", {"an array of numbers"}},
      {"[[sweep]]\ninput = \"EXX\"\nvalues = [1, nan]\n", "13:14", {"finite"}},
      {"[[sweep]]\ninput = \"EXX\"\nvalues = [1]\nfrom = 2\n", "14:1", {"known key"}},
      {"[[sweep]]\ninput = \"EXX\"\nfrom = -1e308\nto = 1e308\n", "13:8", {"sweep.from", "1e+12"}},
      {"[[sweep]]\ninput = \"EXX\"\nfrom = 0\nto = 1\nsteps = 100000000\n", "15:9", {"100000"}},
      {"[worst_case]\ncoverage = -1\n", "12:12", {"coverage"}},
      {"[tolerance]\n", "11:1", {"limit_um"}},
      {"[tolerance]\nlimit_um = 0\n", "12:12", {"limit_um"}},
      {"[tolerance]\nlimit_mm = 1\n", "12:1", {"limit_um"}},
      {"[tolerance]\nlimit_um = 5\nresponse = \"mean\"\n", "13:12", {"pv"}},
      {"[tolerance]\nlimit_um = 5\nconfidence = 1\n", "13:14", {"confidence"}},
      {"[tolerance]\nlimit_um = 5\nmachines = 1\n", "13:12", {"machines"}},
      {"[uncertainty]\nmachines = 1000000000\n", "12:12", {"machines"}},
      {"[influence]\npictures = [\"EXY\"]\n", "12:12", {"nearest: \"EXX\""}},
      {"[influence]\npictures = [3]\n", "12:13", {"a string"}},
      {"[influence]\nmost_rivals = 0\n", "12:15", {"most_rivals"}},
      {"[influence]\nreach_um = 0\n", "12:12", {"reach_um"}},
      {"[influence]\nsheet = 1\n", "12:9", {"true or false"}},
      {"[histories]\n", "11:1", {"train", "variants"}},
      {"[histories]\ntrain = [\"\"]\ntest = [\"nobody\"]\n", "11:1", {"\"leaning\"", "\"nobody\""}},
      {"[histories]\ntrain = [\"\"]\ntest = [\"leaning\"]\ncase = \"perfect-iterated-ideal\"\n",
       "11:1",
       {"only temperatures"}},
      {"[histories]\ntrain = [\"\"]\ntest = [\"leaning\"]\ncase = \"tea\"\n", "11:1", {"tea"}},
      {"[limits]\npv_um = -3\n", "12:9", {"pv_um"}},
      {"[limits]\nmean_um = 3\n", "12:1", {"known key"}},
      {"[limits]\nstd_um = 3\n", "11:1", {"responses", "std_um"}},
      {"[[correlation]]\nfirst = \"EXX\"\nsecond = \"EXX\"\nrho = 0.5\n",
       "13:10",
       {"an input other than"}},
      {"[[correlation]]\nfirst = \"EXX\"\nsecond = \"EYX[2]\"\nrho = 1.5\n", "14:7", {"rho"}},
      {"[[correlation]]\nfirst = \"EXX\"\nsecond = \"EYX[2]\"\n", "11:1", {"rho"}},
      {"[[correlation]]\nfirst = \"EXX\"\nsecond = \"EYX[3]\"\nrho = 0\n",
       "13:10",
       {"nearest: \"EYX[2]\""}},
      {"[[input]]\nelement = \"EXX\"\nspread = 1\n", "11:1", {"\"EXX\" again"}},
      {"[[input]]\nelement = \"EXX\"\nname = \"b\"\nspread = 1\n", "11:1", {"EXX", "\"b\""}},
      {"[[input]]\npath = \"setup.EX_um\"\nname = \"b\"\nspread = 1\n", "11:1", {"setup.EX_um"}},
      {"[[input]]\nelement = \"EYY\"\n", "11:1", {"spread"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 0\n", "13:10", {"spread"}},
      {"[[input]]\nelement = \"EYY\"\nspread = -1\n", "13:10", {"spread"}},
      {"[[input]]\nelement = \"EYY\"\nspread = nan\n", "13:10", {"finite"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1e308\ncentre = 1e308\n",
       "13:10",
       {"<= 1000000000000"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\nlow = 3\nhigh = 2\n", "13:10", {"low limit"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\nlow = 1e6\n", "13:10", {"contain part"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\ncost = 0\n", "14:8", {"cost"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\nfactor = 2\n", "14:10", {"path"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\ndistribution = \"cauchy\"\n",
       "14:16",
       {"log_normal"}},
      {"[[input]]\nelement = \"EYY\"\nspread = 1\ncentre = 0\ndistribution = \"log_normal\"\n",
       "13:10",
       {"median above 0"}},
      {"[[input]]\nelement = \"EYY\"\nnumber = \"EYX[1]\"\nspread = 1\n", "11:1", {"several"}},
      {"[[input]]\nspread = 1\n", "11:1", {"none"}},
      {"[[input]]\nelement = \"QQQ\"\nspread = 1\n", "11:1", {"\"QQQ\""}},
      {"[[input]]\nnumber = \"EYX[99]\"\nspread = 1\n", "11:1", {"nearest"}},
      {"[[input]]\npath = \"setup.EXX_um\"\nspread = 1\n", "11:1", {"known key", "EXX_um"}},
      {"[[input]]\npath = \"setup.EX_mm\"\nspread = 1\n", "11:1", {"EX"}},
      {"[[input]]\npath = \"nothing.at.all\"\nspread = 1\n", "11:1", {"known key"}},
      {"[[input]]\npath = \"setup\"\nspread = 1\n", "11:1", {"setup"}},
      {"[[input]]\npath = \"\"\nspread = 1\n", "11:1", {"path"}},
      {"[[input]]\npath = 3\nspread = 1\n", "12:8", {"a list of strings"}},
      {"[[input]]\npath = [\"setup.EY_um\", 3]\nspread = 1\n", "12:24", {"a string"}},
      {"[[input]]\npath = \"part.vertices\"\nspread = 1\ncentre = 300\n",
       "11:1",
       {"engine = \"full\"", "part.vertices"}},
      {"[[input]]\npath = \"tool.nominal.radius_mm\"\nspread = 0.1\ncentre = 5\n", "11:1", {""}},
      {"[[input]]\npath = \"tool.actual.length_mm\"\nspread = 0.01\nlow = 99\nhigh = 101\n",
       "11:1",
       {"centre = 100 (the nominal value) or another number",
        "does not state tool.actual.length_mm"}},
      {"[[input]]\npath = \"tool.actual.length_mm\"\nspread = 0.01\nlow = 99\nhigh = 101\n"
       "centre = 102\n",
       "16:10",
       {"a centre within low and high", "102"}},
      {"[[inputs]]\n", "11:1", {"every"}},
      {"[[inputs]]\nevery = \"elemnt\"\n", "12:9", {"nearest: \"element\""}},
      {"[[inputs]]\nevery = \"element\"\nof = [\"EXQ\"]\n", "13:6", {"nearest"}},
      {"[[inputs]]\nevery = \"element\"\nof = [\"EYY\"]\nspred = 3\n", "14:1", {"spread"}},
      {"[[inputs]]\nevery = \"element\"\n", "11:1", {"\"EXX\" again"}},
      {"[[inputs]]\nevery = \"covariance\"\n", "11:1", {"abbe identify"}},
      {"[[inputs]]\nevery = \"number\"\nof = [\"EXS\", \"EYS\"]\ndistribution = \"log_normal\"\n"
       "centre = 1\n",
       "11:1",
       {"median above 0", "EYS"}},
      {"[[inputs]]\nevery = \"number\"\nof = [\"EXS\"]\ncentre = 1e308\n",
       "14:10",
       {"inputs.centre", "1e+12"}},
      {"input = 3\n", "", {}},
  };
  for (const auto& one : cases) {
    SCOPED_TRACE(one.more);
    if (one.place.empty())
      EXPECT_NE(refusal(three_inputs + one.more), "");
    else
      expect_refused(three_inputs + one.more, one.place, one.words);
  }
}

TEST_F(ReadStudy, RefusesTopKeysAtTheirPlace) {
  const struct {
    std::string line, place;
    std::vector<std::string> words;
  } cases[] = {
      {"engne = \"full\"", "1:1", {"engine"}},
      {"engine = \"ful\"", "1:10", {"nearest: \"full\""}},
      {"engine = \"both\"", "1:10", {"[monte_carlo]"}},
      {"seed = -1", "1:8", {"seed"}},
      {"seed = 9223372036854775808", "1:", {""}},
      {"seed = 1.5", "1:8", {"seed"}},
      {"proofs = 0", "1:10", {"proofs"}},
      {"title = 3", "1:9", {"title"}},
      {"cases = [\"nobody\"]", "1:9", {"uncompensated", "nobody"}},
      {"cases = [\"uncompensated\", \"uncompensated\"]", "1:9", {"once"}},
      {"cases = 5", "1:9", {"strings"}},
      {"variants = [\"leening\"]", "", {"\"leaning\"", "\"leening\""}},
      {"responses = [\"pvv\"]", "1:13", {"in_tolerance", "pvv"}},
      {"responses = [1]", "1:14", {"a string"}},
      {"of = \"spindle\"", "1:6", {"residual"}},
      {"set = 3", "1:7", {"a table"}},
      {"set = { part.vertces = 3 }", "", {"vertices"}},
      {"set = { part.vertices = 1000000000000 }", "", {"vertices"}},
      {"date = 2020-01-01", "1:1", {"known key"}},
  };
  for (const auto& one : cases) {
    SCOPED_TRACE(one.line);
    const std::string text = one.line + "\n" + three_inputs;
    if (one.place.empty()) {
      const std::string said = refusal(text);
      for (const std::string& word : one.words) EXPECT_HAS(said, word);
    } else {
      const std::string said = refusal(text);
      EXPECT_HAS(said, "study.toml:" + one.place);
      for (const std::string& word : one.words) EXPECT_HAS(said, word);
    }
  }
}

TEST_F(ReadStudy, RefusesQuestionsThatTheEngineCannotAnswer) {
  for (const char* one : {"[worst_case]\n", "[tolerance]\nlimit_um = 3\n", "[uncertainty]\n"}) {
    SCOPED_TRACE(one);
    expect_refused("engine = \"full\"\n" + three_inputs + one, "1:10", {"\"influence\""});
  }
  expect_refused(three_inputs +
                     "[[correlation]]\nfirst = \"EXX\"\nsecond = \"EYX[2]\"\nrho = 0.5\n"
                     "[sobol_indices]\n",
                 "15:1", {"independent inputs"});
}

TEST_F(ReadStudy, RefusesCorrelationsThatCannotBe) {
  const auto pair = [](const std::string& a, const std::string& b, const std::string& rho) {
    return "[[correlation]]\nfirst = \"" + a + "\"\nsecond = \"" + b + "\"\nrho = " + rho + "\n";
  };
  const std::string x = "EXX", y = "setup.EX_um", z = "EYX[2]";
  expect_refused(three_inputs + pair(x, y, "-1") + pair(y, z, "-1") + pair(x, z, "-1"), "11:1",
                 {"valid correlations"});
  expect_refused(three_inputs + pair(x, y, "0.9") + pair(y, z, "0.9") + pair(x, z, "-0.9"), "11:1",
                 {"valid correlations"});
  expect_refused(three_inputs + pair(x, y, "0.5") + pair(y, x, "0.5"), "15:1", {"once"});
  EXPECT_EQ(refusal(three_inputs + pair(x, y, "1") + pair(y, z, "-1") + pair(x, z, "-1")), "")
      << "full correlation can be";
}

TEST_F(ReadStudy, RefusesAreaInToleranceOfAPartWithoutOne) {
  const std::string text = "responses = [\"in_tolerance\"]\n" + three_inputs;
  EXPECT_EQ(refusal(text), "");
  folder_.write("scene.toml", with(small_scene(), "tolerance_um = 20\n", ""));
  expect_refused(text, "1:13", {"tolerance_um"});
}

TEST_F(ReadStudy, TellsEveryFaultAtOnce) {
  const std::string said = refusal("seed = -1\nproofs = 0\n" + three_inputs +
                                   "[one_at_a_time]\nstep = -1\n[monte_carlo]\ncases = 0\n");
  for (const char* word : {"seed", "proofs", "step", "cases"}) EXPECT_HAS(said, word);
}

TEST_F(ReadStudy, RefusesMissingBrokenAndCyclicScenes) {
  const auto scene = [&](const std::string& name) {
    return refusal(with(three_inputs, "scene.toml", name));
  };
  EXPECT_HAS(scene("none.toml"), "none.toml");
  EXPECT_HAS(scene("study.toml"), "study.toml") << "the study itself";
  EXPECT_HAS(scene("."), "expected") << "a folder";
  EXPECT_HAS(scene("/dev/null"), "expected");
  folder_.write("broken.toml", "machine = [\n");
  EXPECT_HAS(scene("broken.toml"), "broken.toml:");
  folder_.write("cycle.toml", with(small_scene(), "title", "errors = \"cycle.toml\"\ntitle"));
  EXPECT_NE(scene("cycle.toml"), "");
  EXPECT_HAS(refusal(with(three_inputs, "scene = \"scene.toml\"\n", "")), "scene");
  EXPECT_HAS(refusal(with(three_inputs, "\"scene.toml\"", "3")), "a string");
  EXPECT_HAS(refusal("scene = \"scene.toml\"\n"), "[[input]]");
  EXPECT_NE(refusal_by([&] { read_study(folder_ / "no_study.toml"); }), "");
  EXPECT_NE(refusal_by([&] { read_study(folder_.path()); }), "");
}

// ---------------------------------------------------------------- hostile

TEST_F(ReadStudy, RefusesHugeAndDeepAndBinaryText) {
  EXPECT_NE(refusal(std::string(20 << 20, '#')), "") << "more than 16 MiB";
  EXPECT_NE(refusal("a = " + std::string(20000, '[')), "");
  EXPECT_NE(refusal("a = " + std::string(5000, '[') + std::string(5000, ']')), "");
  std::string deep = "x";
  for (int i = 0; i < 2000; ++i) deep += ".x";
  EXPECT_NE(refusal(deep + " = 1\n"), "");
  EXPECT_NE(refusal(three_inputs + "[[input]]\npath = \"" + deep + "\"\nspread = 1\n"), "");
  EXPECT_NE(refusal(std::string("scene\0", 6)), "");
  EXPECT_NE(refusal("\xff\xfe\xfa"), "");
  EXPECT_NE(refusal(""), "");
}

TEST_F(ReadStudy, TakesTenMegabytesOfRemarksAndRefusesAsManyInputs) {
  std::string remarks;
  while (remarks.size() < (10u << 20)) remarks += "# nothing but words, line after line\n";
  EXPECT_EQ(refusal(remarks + three_inputs), "");
  std::string inputs = "scene = \"scene.toml\"\n";
  for (int i = 0; i < 20000; ++i)
    inputs += "[[input]]\npath = \"p" + std::to_string(i) + "\"\nspread = 1\n";
  EXPECT_HAS(refusal(inputs), "2000 inputs");
  std::string sweeps = three_inputs;
  for (int i = 0; i < 3000; ++i)
    sweeps += "[[sweep]]\ninput = \"EXX\"\nfrom = 0\nto = 1\nsteps = 10000\n";
  EXPECT_HAS(refusal(sweeps), "1000 sweeps");
}

// A belief's own covariance has spreads of some nanometres, which nobody wrote in a wrong unit.
TEST(PackagedStudies, WarnOfNothing) {
  int studies = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(ABBE_SOURCE_DIR) / "scenes/studies"))
    if (entry.path().extension() == ".toml") {
      const Study study = read_study(entry.path());
      const Scene scene = read_scene(study.scene, study.overrides);
      EXPECT_EQ(study_warnings(study, scene), std::vector<std::string>()) << entry.path();
      ++studies;
    }
  EXPECT_GE(studies, 3);
}

TEST_F(ReadStudy, ReadsOrRefusesAnInjuredStudy) {
  const unsigned seed = 6;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const std::string whole =
      "# what nobody knows exactly about a small machine, and what is asked of it\n"
      "title = \"a study that is injured again and again\"\n" +
      three_inputs +
      "[[correlation]]\nfirst = \"EXX\"\nsecond = \"EYX[2]\"\nrho = 0.5\n[one_at_a_time]\n"
      "step = 1\n[monte_carlo]\ncases = 100\n[[sweep]]\ninput = \"EXX\"\nfrom = 0\nto = 1\n"
      "[tolerance]\nlimit_um = 20\n[influence]\nchecks = 2\n";
  ASSERT_EQ(refusal(whole), "");
  int read = 0, refused = 0;
  // Of 130 texts 16 are read as of 400 are 50; 6 or fewer once in 200 times.
  const int texts = std::getenv("ABBE_LONG") != nullptr ? 400 : 130;
  for (int k = 0; k < texts; ++k) {
    const std::string fodder = "0159.-+eE[]{}\"',#= \n\r\\infnan\xc3";
    const std::string text = injured(whole, fodder, std::size_t(1 + k % 3), random);
    SCOPED_TRACE(text);
    try {
      const Study study = this->read(text);
      EXPECT_FALSE(study.inputs.empty());
      EXPECT_TRUE(centre(study).allFinite() && spreads(study).allFinite());
      ++read;
    } catch (const BadScene& bad) {
      EXPECT_FALSE(bad.input_errors.empty());
      ++refused;
    }
  }
  std::cout << "seed " << seed << ": of " << texts << " injured studies " << read << " were read, "
            << refused << " refused\n";
  EXPECT_GT(read, texts / 20);
  EXPECT_GT(refused, texts / 4);
}

}  // namespace
}  // namespace abbe::sim::study
