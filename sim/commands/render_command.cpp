#include "sim/commands/render_command.h"

#include <array>
#include <charconv>
#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/rendered_result.h"

namespace abbe::sim {
namespace {

/// Options whose words are still to be read.
struct RenderWords {
  RenderOptions options;
  std::optional<std::string> view, range, bands, size, Nic, Nis;
  std::optional<std::int64_t> sections;
};

/// Numbers between separators; none if it is anything else.
std::optional<std::vector<double>> numbers_of(const std::string& text, char separator) {
  std::vector<double> values;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (true) {
    if (at != end && *at == '+') ++at;
    double value = 0.0;
    const auto [next, fault] = std::from_chars(at, end, value);
    if (fault != std::errc() || !std::isfinite(value)) return std::nullopt;
    values.push_back(value);
    if (next == end) return values;
    if (*next != separator) return std::nullopt;
    at = next + 1;
  }
}

/// "+x" ... "-z", "iso", or a direction "x,y,z".
Eigen::Vector3d direction_of(const std::string& text) {
  if (text == "iso") return {1.0, -1.0, 1.0};
  const std::string axes = "xyz";
  if (text.size() == 2 && (text[0] == '+' || text[0] == '-') &&
      axes.find(text[1]) != std::string::npos)
    return (text[0] == '+' ? 1.0 : -1.0) * Eigen::Vector3d::Unit(Eigen::Index(axes.find(text[1])));
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 3 && Eigen::Vector3d((*v)[0], (*v)[1], (*v)[2]).norm() > 0.0)
    return {(*v)[0], (*v)[1], (*v)[2]};
  throw BadUsage("--view",
                 "expected +x, -x, +y, -y, +z, -z, iso or a direction as 1,-1,0.5, seen " + text);
}

Tolerance bands_of(const std::string& text) {
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0)
    return {-v->front() * units::um, v->front() * units::um};
  if (v && v->size() == 2 && (*v)[0] < (*v)[1]) return {(*v)[0] * units::um, (*v)[1] * units::um};
  throw BadUsage("--bands", "expected micrometres, 5 or -2,8, the lower limit first, seen " + text);
}

std::array<int, 2> size_of(const std::string& text) {
  constexpr double least = 320.0, most = 16384.0;
  const auto v = numbers_of(text, 'x');
  const auto is_side = [](double px) { return px >= least && px <= most && px == std::round(px); };
  if (v && v->size() == 2 && is_side((*v)[0]) && is_side((*v)[1]))
    return {int((*v)[0]), int((*v)[1])};
  throw BadUsage("--size", "expected pixels as 1600x1200, each from 320 to 16384, seen " + text);
}

double positive_of(const char* option, const char* unit, const std::string& text) {
  const auto v = numbers_of(text, ',');
  if (v && v->size() == 1 && v->front() > 0.0) return v->front();
  throw BadUsage(option, fmt::format("expected {} above 0, seen {}", unit, text));
}

RenderOptions read(const RenderWords& words) {
  RenderOptions options = words.options;
  if (words.Nic) options.texture.Nic = positive_of("--nic", "millimetres", *words.Nic);
  if (words.Nis) options.texture.Nis = units::um * positive_of("--nis", "micrometres", *words.Nis);
  if (words.sections) options.texture.sections = int(*words.sections);
  if (words.view) options.from = direction_of(*words.view);
  if (words.range) options.range_um = positive_of("--range", "micrometres", *words.range);
  if (words.bands) options.bands = bands_of(*words.bands);
  if (words.size) options.size = size_of(*words.size);
  return options;
}

void print_rendered(const Rendered& rendered, bool json) {
  if (json) {
    nlohmann::ordered_json all = {{"picture", rendered.picture.string()}};
    for (const std::filesystem::path& file : rendered.files) all["files"].push_back(file.string());
    if (rendered.texture) all["profile"] = to_json(*rendered.texture);
    print("{}", Lines(json_text(all)));
  } else {
    if (rendered.texture) print("{}\n", Lines(to_text(*rendered.texture)));
    print("picture in {}\n", rendered.picture.string());
    for (const std::filesystem::path& file : rendered.files) print("file in {}\n", file.string());
  }
  if (rendered.texture) print_warnings(rendered.texture->warnings);
}

}  // namespace

Command render_command(Common& common) {
  const auto words = std::make_shared<RenderWords>();
  RenderOptions& options = words->options;
  return {
      "render",
      "Draw a finished result again, or a difference of two",
      {"abbe render out/dome/uncompensated --line radius",
       "abbe render out/twice --minus out/dome/error_free --out out/difference",
       "abbe render out/dome/uncompensated --bands -2,8 --view +z --format pdf"},
      {{"RESULT", &options.result, "residual.vtp or a folder that has one"},
       {"--minus", &options.minus, "another result, taken away vertex by vertex"},
       {"--line", &options.line,
        "profile along x, y or radius instead of the map, with its parameters by ISO 21920",
        OneOf{{"x", "y", "radius"}}},
       {"--nic", &words->Nic,
        "nesting index Nic of that line, between waviness and roughness (the part's "
        "form_cutoff_mm)",
        Type{"MM"}, Needs{"--line"}},
       {"--nis", &words->Nis,
        "nesting index Nis of that line, below which all is smoothed (that of the setting class)",
        Type{"UM"}, Needs{"--line"}},
       {"--sections", &words->sections,
        "section lengths of Nic over which roughness is evaluated (5)", Between{1, 1000},
        Needs{"--line"}},
       {"--view", &words->view, "where the eye is: +x ... -z, iso or a direction 1,-1,0.5",
        Type{"FROM"}},
       {"--range", &words->range, "the colour scale runs from -UM to UM micrometres", Type{"UM"}},
       {"--bands", &words->bands,
        "colours in, over and under a tolerance in micrometres: 5, or -2,8", Type{"UM"}},
       {"--colours", &options.colours,
        "of the map (those of the tolerance with --bands, else diverging)",
        OneOf{{"diverging", "cividis", "tolerance"}}},
       {"--isolines", &options.isolines, "lines of equal deviation at the ticks of the scale"},
       {"--size", &words->size, "pixels (1600x1200)", Type{"WxH"}},
       {"--format", &options.format,
        "of the picture; in svg and pdf the map itself is a raster, all else sharp",
        OneOf{{"png", "svg", "pdf"}}},
       {"--out", &options.out, "folder for the pictures (that of RESULT)"},
       json_option(common),
       force_option(common),
       threads_option(common, "most threads to use")},
      [words, &common] {
        words->options.permissions = common.permissions;
        print_rendered(render_result(read(*words)), common.json);
        return Exit::Ok;
      }};
}

}  // namespace abbe::sim
