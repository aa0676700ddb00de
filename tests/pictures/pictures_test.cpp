// The pictures of the documents are what the program draws. ABBE_WRITE_PICTURES=1 draws them all
// and writes them; those that take a moment are held in every run, all of them under ABBE_LONG=1.

#include "tests/render/picture.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

/// A picture of the documents, and how it is made.
struct Made {
  std::string name;
  std::vector<std::string> commands;  ///< of abbe, run in the source folder; OUT is a folder
  std::string drawn;                  ///< in that folder
  bool quick = false;
  std::string needs = {};  ///< a file of the source folder without which it cannot be drawn
};

/// Unpacked by `./abbe setup --linuxcnc`.
const std::string linuxcnc = "build/linuxcnc/usr/bin/rs274";

std::vector<Made> pictures() {
  return {
      {"gantry_check", {"check scenes/gantry_dome.toml --picture --out OUT"}, "check.png", true},
      {"gantry_volumetric",
       {"pose scenes/gantry_dome.toml --grid --out OUT"},
       "volumetric.png",
       true},
      {"gantry_dome", {"compare scenes/gantry_dome.toml --out OUT"}, "comparison.png"},
      {"gantry_warmup", {"compare scenes/gantry_warmup.toml --out OUT"}, "comparison.png"},
      {"gantry_belief",
       {"measure scenes/gantry_calibration.toml --out OUT/read",
        "identify OUT/read/*.csv --choose-orders --pitch X=16,Y=16,Z=12 --out OUT/belief.toml"},
       "belief.png"},
      {"gantry_compensated",
       {"compare scenes/gantry_dome.toml --set part.vertices=20000 --set "
        "belief.identified=beliefs/gantry.toml --set "
        "'compare.cases=[\"identified-iterated-ideal\", \"identified-iterated-program\"]' "
        "--compensator scenes/compensators/mirror.py --compensator scenes/compensators/table.py "
        "--out OUT"},
       "comparison.png"},
      {"platform_plane", {"compare scenes/platform_plane.toml --out OUT"}, "comparison.png"},
      {"gantry_fused", {"compare scenes/gantry_fused.toml --out OUT"}, "comparison.png"},
      {"gantry_influence",
       {"study scenes/studies/gantry_dome_budget.toml --out OUT"},
       "influence-sheet.png"},
      {"linuxcnc_boat", {"run scenes/linuxcnc/boat.toml --out OUT"}, "stock.png", false, linuxcnc},
      {"linuxcnc_impeller",
       {"run scenes/linuxcnc/impeller.toml --out OUT"},
       "stock.png",
       false,
       linuxcnc},
  };
}

/// Mean colours of the cells of a grid that is 64 wide: what is seen of it from afar.
std::vector<double> seen(const test::Image& image) {
  constexpr int columns = 64;
  const int rows = std::max(1, columns * image.height() / image.width());
  std::vector<double> means;
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      double sum[3] = {0.0, 0.0, 0.0};
      const int x0 = i * image.width() / columns, x1 = (i + 1) * image.width() / columns;
      const int y0 = j * image.height() / rows, y1 = (j + 1) * image.height() / rows;
      for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x) {
          const test::Pixel p = image.at(x, y);
          sum[0] += p.r, sum[1] += p.g, sum[2] += p.b;
        }
      for (const double one : sum) means.push_back(one / double((x1 - x0) * (y1 - y0)));
    }
  return means;
}

/// Largest difference of a cell, of 255; 255 where the sizes differ.
double difference(const fs::path& a, const fs::path& b) {
  const test::Image first(a), second(b);
  if (first.width() != second.width() || first.height() != second.height()) return 255.0;
  const std::vector<double> x = seen(first), y = seen(second);
  double largest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) largest = std::max(largest, std::abs(x[i] - y[i]));
  return largest;
}

// a letter more or less in a cell is 20, edges drawn by another driver are 3
constexpr double alike = 8.0;

class Pictures : public test::Folder {
 protected:
  /// Empty if a command failed.
  fs::path draw(const Made& made) const {
    const fs::path out = file(made.name);
    for (std::string command : made.commands) {
      for (auto at = command.find("OUT"); at != std::string::npos; at = command.find("OUT"))
        command.replace(at, 3, out.string());
      const std::string line = std::string("cd '") + ABBE_SOURCE_DIR + "' && " + ABBE_PROGRAM +
                               " " + command + " >/dev/null 2>&1";
      const int status = std::system(line.c_str());
      // plug-ins and limits may have their say: the picture counts
      if (status != 0) std::cout << made.name << ": exit " << status / 256 << "\n";
    }
    const fs::path drawn = out / made.drawn;
    return fs::exists(drawn) ? drawn : fs::path();
  }
};

bool asked_for(const char* variable) { return std::getenv(variable) != nullptr; }

TEST_F(Pictures, OfTheDocumentsAreWhatTheProgramDraws) {
  const bool writes = asked_for("ABBE_WRITE_PICTURES");
  for (const Made& made : pictures()) {
    if (!made.quick && !writes && !asked_for("ABBE_LONG")) continue;
    if (!made.needs.empty() && !fs::exists(fs::path(ABBE_SOURCE_DIR) / made.needs)) {
      std::cout << made.name << ": not drawn, there is no " << made.needs << "\n";
      continue;
    }
    const fs::path drawn = draw(made);
    if (drawn.empty()) {
      ADD_FAILURE() << made.name << " was not drawn";
      continue;
    }
    const fs::path kept = fs::path(ABBE_SOURCE_DIR) / "scenes/pictures" / (made.name + ".png");
    if (writes) fs::copy_file(drawn, kept, fs::copy_options::overwrite_existing);
    const double off = difference(drawn, kept);
    std::cout << made.name << ": differs by " << off << " of 255\n";
    EXPECT_LE(off, alike) << made.name
                          << " is stale; ABBE_WRITE_PICTURES=1 pictures_test writes it";
  }
}

TEST_F(Pictures, ThatDifferAreFound) {
  const fs::path folder = fs::path(ABBE_SOURCE_DIR) / "scenes/pictures";
  EXPECT_EQ(difference(folder / "gantry_check.png", folder / "gantry_check.png"), 0.0);
  const fs::path one =
      draw({"one", {"check scenes/gantry_dome.toml --picture --out OUT"}, "check.png"});
  const fs::path other =
      draw({"other",
            {"check scenes/gantry_dome.toml --picture --set part.rim_radius_mm=45 --out OUT"},
            "check.png"});
  ASSERT_FALSE(one.empty() || other.empty());
  std::cout << "a dome a tenth smaller differs by " << difference(one, other) << "\n";
  EXPECT_GT(difference(one, other), 2.0 * alike);
}

}  // namespace
}  // namespace abbe::render
