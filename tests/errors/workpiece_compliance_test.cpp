#include "errors/compliance.h"
#include "tests/errors/refusal.h"
#include "tests/oracles/beam.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Bar

TEST(WorkpieceBar, GivesWayByTheCubeOfItsArmAcrossItself) {
  const WorkpieceBar bar{{1, 2, 3}, {0, 0, 1}, 80.0, 400.0, 7e4};
  const double EI = 7e4 * 400.0;
  for (const double arm : {0.0, 1e-12, 20.0, 80.0}) {
    const Matrix3d C = local_compliance(WorkpieceCompliance(bar), Vector3d(5, -7, 3 + arm));
    const Vector3d expected(arm * arm * arm / (3 * EI), arm * arm * arm / (3 * EI), 0);
    EXPECT_LT((C - Matrix3d(expected.asDiagonal())).norm(), 1e-18) << arm;
  }
  const oracles::BeamPiece piece{80.0, EI};
  EXPECT_NEAR(local_compliance(WorkpieceCompliance(bar), Vector3d(0, 0, 83))(0, 0),
              oracles::beam_end({&piece, 1}, 80.0, 1.0, 0.0).deflection, 1e-12);
  EXPECT_TRUE(local_compliance(WorkpieceCompliance(bar), Vector3d(1, 2, -5)).isZero(0.0))
      << "below the clamp";
  EXPECT_EQ(local_compliance(WorkpieceCompliance(bar), Vector3d(1, 2, 500)),
            local_compliance(WorkpieceCompliance(bar), Vector3d(1, 2, 83)))
      << "beyond the end as at the end";
}

TEST(WorkpieceBar, StandsInAnyDirection) {
  const Vector3d u = Vector3d(1, -2, 0.5).normalized();
  const WorkpieceBar bar{{0, 0, 0}, u, 50.0, 100.0, 2e5};
  const Matrix3d C = local_compliance(WorkpieceCompliance(bar), Vector3d(30 * u));
  EXPECT_LT((C * u).norm(), 1e-18);
  const Vector3d across = u.unitOrthogonal();
  EXPECT_LT((C * across - 27000.0 / (3 * 2e5 * 100) * across).norm(), 1e-16);
}

// Plate

/// Under a load on the free edge the deflection per wave number has a form of its own, which the
/// trapezoidal rule integrates in log k to rounding.
double at_free_edge(double nu) {
  const auto per_wave = [&](double k) {
    const double k3 = k * k * k;
    if (k > 300.0) return 2.0 / k3 / ((3 + nu) * (1 - nu));
    const double c = std::cosh(k);
    const double lift = k < 0.05
                            ? 2.0 * k3 / 3.0 * (1.0 + k * k / 5.0 + 2.0 * k * k * k * k / 105.0)
                            : std::sinh(k) * c - k;
    return 2.0 / k3 * lift /
           ((3 + nu) * (1 - nu) * c * c + (1 - nu) * (1 - nu) * k * k + (1 + nu) * (1 + nu));
  };
  const double step = 1e-3;
  double sum = 0.0;
  for (double v = -30.0; v < 20.0; v += step) sum += per_wave(std::exp(v)) * std::exp(v) * step;
  return sum / pi;
}

TEST(CantileverPlate, AtTheFreeEdgeAgreesWithItsOwnFormula) {
  double worst = 0.0;
  for (const double nu : {-0.9, -0.3, 0.0, 0.25, 0.3, 0.33, 0.5})
    worst = std::max(worst, std::abs(cantilever_plate(1.0, nu) / at_free_edge(nu) - 1.0));
  std::cout << "nu = 0.3: " << cantilever_plate(1.0, 0.3) << " c^2/D, worst relative " << worst
            << "\n";
  EXPECT_LT(worst, 1e-9);
  // Jaramillo's printed figure is a series cut short, 0.9 % above the truth
  EXPECT_NEAR(cantilever_plate(1.0, 0.3), 0.168, 0.002);
}

TEST(CantileverPlate, KeepsItsDigitsInside) {
  // The same boundary value problem solved with at least 30 digits; it holds the arithmetic, the
  // finite elements below hold the equations.
  const struct {
    double s, nu, value;
  } rows[] = {{0.1, 0.3, 0.000807048503968038},
              {0.25, 0.3, 0.00536234211796968},
              {0.5, 0.3, 0.0252913728009011},
              {0.75, 0.0, 0.0648861416916311},
              {0.9, 0.33, 0.120262758692122}};
  for (const auto& row : rows)
    EXPECT_NEAR(cantilever_plate(row.s, row.nu) / row.value, 1.0, 1e-9) << row.s;
}

TEST(CantileverPlate, AgreesWithFiniteElementsWhichStayBelow) {
  double worst = 0.0;
  for (const double nu : {0.0, 0.3, 0.5}) {
    for (const double s : {0.05, 0.2, 0.5, 0.8, 0.97, 1.0}) {
      const double ours = cantilever_plate(s, nu);
      const double coarse = oracles::plate_under_load(s, nu, 0.02 * s);
      const double fine = oracles::plate_under_load(s, nu, 0.002 * s);
      EXPECT_LT(coarse, fine) << "s " << s;
      EXPECT_LT(fine, ours * (1.0 + 1e-7)) << "s " << s;
      worst = std::max(worst, 1.0 - fine / ours);
    }
  }
  std::cout << "finite elements at most " << worst << " below\n";
  EXPECT_LT(worst, 1e-4);
}

TEST(CantileverPlate, NearTheClampIsHalfAnEndlessPlate) {
  for (const double s : {1e-5, 1e-4, 1e-3})
    EXPECT_NEAR(cantilever_plate(s, 0.3) / (s * s), 0.25 / pi, 0.1 * s + 1e-7);
  EXPECT_EQ(cantilever_plate(0.0, 0.3), 0.0);
}

TEST(CantileverPlate, GrowsTowardsTheFreeEdgeWithoutAStep) {
  double before = 0.0;
  for (int i = 1; i <= 1000; ++i) {
    const double now = cantilever_plate(i / 1000.0, 0.33);
    EXPECT_GT(now, before);
    EXPECT_LT(now - before, 1.2e-3) << i;
    before = now;
  }
}

const WorkpiecePlate thin_wall{{10, 0, 5}, {0, 0, 1}, {1, 0, 0}, 30.0, 3.0, 7e4, 0.33};

TEST(WorkpiecePlate, GivesWayAlongItsNormalByTheFormula) {
  const double D = 7e4 * 27.0 / (12.0 * (1 - 0.33 * 0.33));
  const Matrix3d C = local_compliance(WorkpieceCompliance(thin_wall), Vector3d(11.5, 77, 35));
  EXPECT_NEAR(C(0, 0), at_free_edge(0.33) * 900.0 / D, 1e-9 * C(0, 0));
  EXPECT_TRUE((C - Matrix3d(Vector3d(C(0, 0), 0, 0).asDiagonal())).isZero(0.0));
  EXPECT_TRUE(local_compliance(WorkpieceCompliance(thin_wall), Vector3d(11.5, 0, 4)).isZero(0.0));
}

TEST(WorkpiecePlate, AsATableIsWithinItsBound) {
  for (const double nu : {0.0, 0.33, 0.5}) {
    WorkpiecePlate plate = thin_wall;
    plate.poisson_ratio = nu;
    const PreparedWorkpiece table = prepare(plate);
    double worst = 0.0;
    for (int i = 0; i <= 3000; ++i) {
      const double s = i < 1500 ? std::pow(i / 1500.0, 3) : 1.0 - std::pow((i - 1500) / 1500.0, 4);
      const Vector3d p(10, 0, 5 + 30 * s);
      const double exact = local_compliance(WorkpieceCompliance(plate), p)(0, 0);
      const double quick = local_compliance(table, p)(0, 0);
      // below that the integral itself is worse than the limit at the clamp
      if (s > 1e-4) worst = std::max(worst, std::abs(quick / exact - 1.0));
      if (s <= 1e-4 && s > 0.0) {
        const double limit = s * s * 900.0 * 12.0 * (1 - nu * nu) / (7e4 * 27.0) * 0.25 / pi;
        EXPECT_NEAR(quick / limit, 1.0, 1e-4) << s;
      }
    }
    std::cout << "nu " << nu << ": table off by " << worst << " of the value\n";
    EXPECT_LT(worst, 1e-6);
    EXPECT_TRUE(local_compliance(table, Vector3d(10, 0, 5)).isZero(0.0));
    EXPECT_TRUE(local_compliance(table, Vector3d(10, 0, -5)).isZero(0.0));
  }
}

TEST(Workpiece, ThatIsNotPhysicalIsRefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto bar = [](const std::function<void(WorkpieceBar&)>& spoil) {
    WorkpieceBar b{{0, 0, 0}, {0, 0, 1}, 80.0, 400.0, 7e4};
    spoil(b);
    return refusal([&] { prepare(b); });
  };
  const auto plate = [](const std::function<void(WorkpiecePlate&)>& spoil) {
    WorkpiecePlate p = thin_wall;
    spoil(p);
    return refusal([&] { prepare(p); });
  };
  EXPECT_EQ(bar([](auto&) {}), "");
  EXPECT_TRUE(contains(bar([](auto& b) { b.length = 0; }), "a length above 0"));
  EXPECT_TRUE(contains(bar([](auto& b) { b.second_moment = -1; }), "second moment"));
  EXPECT_TRUE(contains(bar([&](auto& b) { b.youngs_modulus = nan; }), "Young's modulus"));
  EXPECT_TRUE(contains(bar([](auto& b) { b.direction_w *= 2; }), "unit vector"));
  EXPECT_TRUE(contains(bar([&](auto& b) { b.clamp_w[1] = nan; }), "clamp"));
  EXPECT_EQ(plate([](auto&) {}), "");
  EXPECT_TRUE(contains(plate([](auto& p) { p.height = 0; }), "a height"));
  EXPECT_TRUE(contains(plate([](auto& p) { p.thickness = -3; }), "a thickness"));
  EXPECT_TRUE(contains(plate([](auto& p) { p.poisson_ratio = 0.51; }), "Poisson"));
  EXPECT_TRUE(contains(plate([](auto& p) { p.normal_w = p.up_w; }), "perpendicular to"));
  EXPECT_TRUE(contains(plate([&](auto& p) { p.foot_w[2] = nan; }), "foot"));
}

// Field

Matrix3d some_compliance(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const Matrix3d A = Matrix3d::NullaryExpr([&] { return unit(random); });
  return 1e-4 * A * A.transpose();
}

/// n nodes on a wavy sheet, some of them twice.
WorkpieceField some_field(int n, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  WorkpieceField field;
  field.points_w.resize(n, 3);
  for (int i = 0; i < n; ++i) {
    const double x = 100 * unit(random), y = 60 * unit(random);
    field.points_w.row(i) << x, y, 5 * std::sin(x / 9) + (i % 7 == 0 ? 0.0 : unit(random));
    if (i % 50 == 49) field.points_w.row(i) = field.points_w.row(i - 1);
    field.compliance_w.push_back(some_compliance(random));
  }
  return field;
}

TEST(WorkpieceField, IsItsNodeAtANodeAndBetweenThemBetween) {
  WorkpieceField field;
  field.points_w.resize(4, 3);
  field.points_w << 0, 0, 0, 10, 0, 0, 0, 10, 0, 10, 10, 0;
  for (int i = 0; i < 4; ++i) field.compliance_w.push_back((i + 1) * 1e-4 * Matrix3d::Identity());
  const PreparedWorkpiece part = prepare(field);
  for (int i = 0; i < 4; ++i)
    EXPECT_EQ(local_compliance(part, Vector3d(field.points_w.row(i).transpose())),
              field.compliance_w[std::size_t(i)]);
  EXPECT_NEAR(local_compliance(part, Vector3d(5, 5, 3))(0, 0), 2.5e-4, 1e-18) << "the mean of four";
  // inverse squared distances by hand at (1, 0, 0): 1, 1/81, 1/101, 1/181
  const double w[] = {1.0, 1.0 / 81, 1.0 / 101, 1.0 / 181};
  const double expected = (w[0] * 1 + w[1] * 2 + w[2] * 3 + w[3] * 4) / (w[0] + w[1] + w[2] + w[3]);
  EXPECT_NEAR(local_compliance(part, Vector3d(1, 0, 0))(1, 1), 1e-4 * expected, 1e-18);
  EXPECT_NEAR(local_compliance(part, Vector3d(1e-300, 0, 0))(1, 1), 1e-4, 1e-18);
  EXPECT_TRUE(std::isnan(
      local_compliance(part, Vector3d(std::numeric_limits<double>::quiet_NaN(), 0, 0))(0, 0)));
}

TEST(WorkpieceField, DoesNotJumpWhereItsNeighboursChange) {
  std::mt19937 random(5);
  const PreparedWorkpiece part = prepare(some_field(2000, random));
  const auto jump = [&](double step) {
    double most = 0.0;
    Matrix3d before = local_compliance(part, Vector3d(20, 30, 4));
    for (double x = 20 + step; x < 21; x += step) {
      const Matrix3d now = local_compliance(part, Vector3d(x, 30, 4));
      most = std::max(most, (now - before).norm());
      before = now;
    }
    return most;
  };
  std::cout << "largest step at 0.1 um: " << jump(1e-4) << ", at 0.01 um: " << jump(1e-5) << "\n";
  EXPECT_LT(jump(1e-5), 0.15 * jump(1e-4)) << "a tenth, were it smooth; the same, did it jump";
}

TEST(WorkpieceField, ByItsTreeIsTheSameAsOneByOne) {
  SeededRandom random(12);
  std::uniform_real_distribution<double> unit(-0.3, 1.3);
  for (const int n : {1, 2, 3, 4, 5, 8, 9, 10, 17, 100, 3000}) {
    const WorkpieceField field = some_field(n, random);
    const PreparedWorkpiece part = prepare(field);
    for (int i = 0; i < 300; ++i) {
      Vector3d p(100 * unit(random), 60 * unit(random), 8 * unit(random));
      if (i % 10 == 0) p = field.points_w.row(i % n).transpose();
      ASSERT_EQ(local_compliance(part, p), local_compliance(WorkpieceCompliance(field), p))
          << n << " nodes";
    }
  }
}

TEST(WorkpieceField, OfAllNodesInOnePlaceOrALineIsReadAsItStands) {
  WorkpieceField field;
  const int n = 200;
  field.points_w = Points::Constant(n, 3, 4.0);
  for (int i = 0; i < n; ++i) field.compliance_w.push_back(1e-4 * (1 + i) * Matrix3d::Identity());
  EXPECT_EQ(local_compliance(prepare(field), Vector3d(4, 4, 4))(0, 0), 1e-4) << "the first of them";
  EXPECT_NEAR(local_compliance(prepare(field), Vector3d(0, 0, 0))(0, 0), 3e-4, 1e-18)
      << "the mean of the first five, as near as one another";
}

TEST(WorkpieceField, OfAHundredThousandNodesIsQuick) {
  std::mt19937 random(3);
  const WorkpieceField field = some_field(100000, random);
  const auto start = std::chrono::steady_clock::now();
  const PreparedWorkpiece part = prepare(field);
  const auto built = std::chrono::steady_clock::now();
  double sum = 0.0;
  for (int i = 0; i < 100000; ++i)
    sum += local_compliance(part, Vector3d(i * 1e-3, 30 + 20 * std::sin(i * 0.01), 2))(0, 0);
  const std::chrono::duration<double> prepared = built - start;
  const std::chrono::duration<double> asked = std::chrono::steady_clock::now() - built;
  std::cout << "prepared in " << prepared.count() << " s, " << asked.count() * 10 << " us a look ("
            << sum << ")\n";
  EXPECT_LT(prepared.count(), 2.0);
  EXPECT_LT(asked.count(), 2.0);
}

TEST(WorkpieceField, CoverageReportsAFieldOfAnotherMesh) {
  std::mt19937 random(8);
  const WorkpieceField field = some_field(5000, random);
  Points same = field.points_w;
  EXPECT_EQ(max_node_distance(field, same), 0.0);
  same.col(2).array() += 0.25;
  EXPECT_LE(max_node_distance(field, same), 0.25 + 1e-12);
  Points inches = field.points_w * 25.4;
  EXPECT_GT(max_node_distance(field, inches), 1000.0);
  Points apart(2, 3);
  apart << 1, 1, 0, 100, 60, 305;  // the sheet lies below 6.1
  const double far = max_node_distance(field, apart);
  EXPECT_GT(far, 298.0);
  EXPECT_LT(far, 311.0);
  EXPECT_EQ(max_node_distance(field, Points(0, 3)), 0.0);
}

TEST(WorkpieceField, RefusesANodeByItsNumber) {
  std::mt19937 random(8);
  const auto why = [&](const std::function<void(WorkpieceField&)>& spoil) {
    WorkpieceField field = some_field(5, random);
    spoil(field);
    return refusal([&] { validate(field); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(why([](auto&) {}), "");
  EXPECT_TRUE(contains(why([](auto& f) { f.compliance_w[2](0, 1) += 1e-4; }),
                       "symmetric compliance at node 3"));
  EXPECT_TRUE(contains(why([](auto& f) { f.compliance_w[4] = -f.compliance_w[4].eval(); }),
                       "negative eigenvalues at node 5"));
  EXPECT_TRUE(contains(why([&](auto& f) { f.compliance_w[0](2, 2) = nan; }),
                       "finite compliance at node 1"));
  EXPECT_TRUE(contains(why([&](auto& f) { f.points_w(1, 0) = nan; }), "finite point at node 2"));
  EXPECT_TRUE(contains(why([](auto& f) { f.compliance_w.pop_back(); }), "one compliance per node"));
  EXPECT_TRUE(contains(why([](auto& f) { f = {}; }), "one compliance per node"));
  EXPECT_EQ(why([](auto& f) { f.compliance_w[0].setZero(); }), "") << "a stiff node is one";
}

// CSV

const std::string head = "x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N";

WorkpieceField read_field(const std::string& text) {
  return read_compliance_field(text, "wall.csv");
}
std::string why(const std::string& text) {
  return refusal([&] { read_field(text); });
}

TEST(ComplianceCsv, ReadsColumnsInAnyOrderAndUnit) {
  const WorkpieceField field = read_field(
      "\xef\xbb\xbf# a wall\r\n\r\nCxz_um_per_N; z_mm;y_mm;x_mm;Czz_um_per_N;Cyy_um_per_N;"
      "Cxx_um_per_N\r\n0.5;3;2;1;5;6;7\r\n\r\n# more\r\n-0.5;+6;5;4e0;1;1;1\r\n");
  ASSERT_EQ(field.points_w.rows(), 2);
  EXPECT_EQ(field.points_w.row(0), Eigen::RowVector3d(1, 2, 3));
  EXPECT_EQ(field.points_w.row(1), Eigen::RowVector3d(4, 5, 6));
  Matrix3d C;
  C << 7e-3, 0, 0.5e-3, 0, 6e-3, 0, 0.5e-3, 0, 5e-3;
  EXPECT_LT((field.compliance_w[0] - C).norm(), 1e-18);
}

TEST(ComplianceCsv, RefusesWithThePlace) {
  EXPECT_TRUE(contains(why("x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N\n1,2,3,4,5\n"),
                       "wall.csv:1:41: expected a column Czz_um_per_N"));
  EXPECT_TRUE(
      contains(why("x_inch," + head + "\n"), "wall.csv:1:1: expected x_mm as the column name"));
  EXPECT_TRUE(contains(why(head + ",x_mm\n"), "each column only once"));
  EXPECT_TRUE(contains(why(head + "\n1,2,3,4,5,1e10\n"), "wall.csv:2:11: expected a number"));
  EXPECT_TRUE(contains(why(head + "\n0,0,0,1,1,1\n0,0,0,1,-1,1\n"),
                       "wall.csv:3:1: expected a compliance without negative eigenvalue"));
  EXPECT_TRUE(contains(why(head + ",Cxy_um_per_N\n0,0,0,1,1,1,1.5\n"), "negative eigenvalue"));
  EXPECT_TRUE(contains(why(std::string((std::size_t(64) << 20) + 1, '#')), "at most 64 MiB"));
  EXPECT_TRUE(contains(why(std::string(1 << 20, ',')), "a column name of x_mm"));
}

}  // namespace
}  // namespace abbe::errors
