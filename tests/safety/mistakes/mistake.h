#pragma once

#include "sim/calibration/calibration.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

/// Mistakes that users make, one a row: a number in another unit, a sign, a name, a file of another
/// machine. A row is a base that is right, one thing wrong in one of its files, and what has to be
/// said of it. The tables hold what can be known from the input to be odd: what no machine, tool,
/// room or program has, or what two inputs contradict each other in. A number that is wrong and as
/// likely as the right one (a feed of 20 mm/min in place of 1200, a part turned by a right angle on
/// a table that has room for it) cannot be known, and is in none of them.
namespace abbe::safety {

using Files = std::map<std::string, std::string>;

enum class Expected { InputError, Warning };

/// What reads the files.
enum class Command {
  Run,       ///< scene.toml, without a compensator
  RunCase,   ///< scene.toml, with the first of its compensators
  Measure,   ///< scene.toml
  Study,     ///< study.toml, without its cases
  Identify,  ///< every .csv
};

/// Options of `identify` that differ from those of the program.
using OptionsChange = std::function<void(sim::IdentificationOptions&)>;

/// Inputs that are right: nothing is said of them.
struct Base {
  std::function<Files()> files;
  Command command = Command::Run;
  OptionsChange options;
};
const std::map<std::string, Base>& bases();

/// A change of a file.
struct Edit {
  /// `was` becomes `is`; all of the file, where `was` is empty; or `is` at its end, where `was` is
  /// "+".
  Edit(std::string file, std::string was, std::string is);
  Edit(std::string file, std::function<std::string(const std::string&)> change)
      : file(std::move(file)), change(std::move(change)) {}

  std::string file;
  std::function<std::string(const std::string&)> change;
};

struct Mistake {
  std::string name, base;
  std::vector<Edit> edits;
  Expected expected;
  std::string says;                     ///< part of the message
  std::optional<Command> command = {};  ///< other than that of the base
  OptionsChange options = {};
  bool is_reported = false;  ///< of a kind that users had reported: does not count as our own
};

/// Returns a row of which a warning has to say this.
inline Mistake warning(std::string name, std::string base, std::vector<Edit> edits,
                       std::string says, std::optional<Command> command = {},
                       OptionsChange options = {}) {
  return {name, base, edits, Expected::Warning, says, command, options};
}

/// Returns a row that has to end with this input error.
inline Mistake input_error(std::string name, std::string base, std::vector<Edit> edits,
                           std::string says, std::optional<Command> command = {},
                           OptionsChange options = {}) {
  return {name, base, edits, Expected::InputError, says, command, options};
}

/// Returns the row as one of a kind that users had reported.
inline Mistake reported(Mistake mistake) {
  mistake.is_reported = true;
  return mistake;
}

std::vector<Mistake> mistakes_in_bodies();
std::vector<Mistake> mistakes_in_compensators();
std::vector<Mistake> mistakes_in_errors();
std::vector<Mistake> mistakes_in_forces();
std::vector<Mistake> mistakes_in_heat();
std::vector<Mistake> mistakes_in_instruments();
std::vector<Mistake> mistakes_in_machines();
std::vector<Mistake> mistakes_in_meshes();
std::vector<Mistake> mistakes_in_programs();
std::vector<Mistake> mistakes_in_readings();
std::vector<Mistake> mistakes_in_scenes();
std::vector<Mistake> mistakes_in_studies();
std::vector<Mistake> mistakes_in_temperatures();
std::vector<Mistake> mistakes_in_tools();

/// Text of a file of the library.
std::string library(const std::string& file);
/// The text with the first `was` as `is`; a failure of the test if there is none.
std::string replaced(std::string text, const std::string& was, const std::string& is);
/// A closed box on z = 0, its sides in squares, as text of an .obj.
std::string box_obj(double x, double y, double z, double scale = 1.0);

/// An .obj with its triangles turned round.
std::string inside_out(const std::string& text);

/// A small dome on the gantry, which a study varies.
Files study_files();
/// Readings of a laser and a square on a machine with three axes: laser.csv and square.csv.
Files readings_files();
/// An hour of drift after a day of work, with the temperatures of 13 sensors: day.csv.
Files day_files();

}  // namespace abbe::safety
