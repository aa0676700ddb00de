#include "sim/report/picture_files.h"

#if ABBE_RENDER

#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "cutting/map/areal_filter.h"
#include "kinematics/units.h"
#include "render/canvas.h"
#include "render/figures.h"
#include "render/machine_picture.h"
#include "render/map_sheet.h"
#include "render/picture.h"
#include "render/plot.h"
#include "render/residual_field.h"
#include "render/residual_map.h"
#include "sim/cut/judged_surface.h"
#include "sim/files/output.h"
#include "sim/report/machine_picture.h"
#include "sim/report/result_pictures.h"

namespace abbe::sim {
namespace {

/// Returns the design in the part frame.
cutting::Design design_m(const Job& job) {
  return cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
}

/// Returns the map with its form.
render::Field map_field(const Job& job, const Verdict& verdict) {
  render::Field field = render::make_field(design_m(job), verdict.alignment.surface);
  field.form_um = verdict.form_map / units::um;
  return field;
}

/// Returns a length in the most readable unit.
std::string length_text(double mm) {
  if (mm >= 0.1 * units::um) return fmt::format("{:.3g} \u00b5m", mm / units::um);
  return mm >= 1e-3 * units::nm ? fmt::format("{:.3g} nm", mm / units::nm) : "below 0.001 nm";
}

/// Returns true if the vertices of a map do not resolve its texture.
bool is_coarse(const Verdict& verdict) {
  return verdict.cut.interpolation &&
         verdict.cut.interpolation->unresolved > max_unresolved_fraction;
}

/// Returns true if the form of a coarse map is drawn in its place: the form is reliable if the
/// filter averages over enough points.
bool shows_form_map(const Job& job, const Verdict& verdict) {
  return is_coarse(verdict) && cutting::resolves_form(job.design_w, job.scene.part.form_cutoff);
}

/// Returns Sz of the texture as text.
std::string texture_height(const Verdict& verdict) {
  return length_text(verdict.texture ? verdict.texture->Sz : 0.0);
}

/// Returns the approximate size of a pixel of one of several maps, mm.
double panel_pixel_mm(const Job& job) {
  constexpr double panel_px = 350.0;  // width of a map
  const auto& vertices = job.design_w.vertices;
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).maxCoeff() / panel_px;
}

/// Returns true if the shortest waves that the sampled mesh resolves are shorter than pixels.
bool is_finer_than_pixel(const Job& job, double pixel_mm) {
  if (!job.sampled || job.design_w.vertices.rows() <= job.sampled->given) return false;
  const double spacing = std::sqrt(job.design_w.area.sum() / double(job.design_w.vertices.rows()));
  // The shortest resolved wave has two samples; to be visible it must be longer than a pixel.
  return 2.0 * spacing < 1.5 * pixel_mm;
}

/// Returns the random error of the form of a map with random points, mm. The filter is a mean over
/// many points, so the error falls with the square root of their number.
double form_noise(const Job& job, const Verdict& verdict) {
  const cutting::Surface& surface = verdict.alignment.surface;
  if (surface.interior_sample != cutting::Surface::InteriorSample::Random || !verdict.texture)
    return 0.0;
  const double density = double(job.design_w.triangles.rows()) / job.design_w.area.sum();
  return verdict.texture->Sq /
         std::sqrt(cutting::effective_value_count(job.scene.part.form_cutoff, density));
}

/// Returns the caption of a map that shows only the form.
std::string form_caption(const Job& job, const Verdict& verdict) {
  const double noise = form_noise(job, verdict);
  const std::string noise_text = noise > 0.0 ? ", ± " + length_text(noise) + " random" : "";
  // The texture is the map minus its form and contains this random error too; only without it is Sz
  // a lower bound.
  return fmt::format("form: waves above {:.3g} mm{}; texture too fine to draw, Sz {}{}",
                     job.scene.part.form_cutoff, noise_text, texture_height(verdict),
                     noise > 0.0 ? ", random part included" : " or more");
}

/// Returns a verdict with the minus signs and units of a picture.
std::string typeset_verdict(std::string text) {
  const auto replace = [&](const std::string& from, const std::string& to) {
    for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
      text.replace(at, from.size(), to);
  };
  replace(" um", " µm");
  replace("-", "−");
  return text;
}

/// Replaces the deviations of a map by its form, which is known only at the vertices.
void replace_by_form(render::Field& field) {
  field.deviation_um = field.form_um;
  field.within_um.resize(0);
}

/// Returns the picture of a map in the part frame, so that the view does not depend on the
/// clamping.
/// @param pixel_mm  approximate size of a pixel: waves finer than it are left out, since they would
/// only cause aliasing; 0: they are drawn
render::MapPicture map_picture(const Job& job, const Verdict& verdict, double pixel_mm = 0.0) {
  render::MapPicture picture;
  picture.field = map_field(job, verdict);
  picture.title = verdict.cut.name;
  picture.figures = figures(verdict.residual);
  if (shows_form_map(job, verdict)) {
    replace_by_form(picture.field);
    picture.figures = figures(*verdict.form_statistics);
    picture.caption.push_back(form_caption(job, verdict));
  } else if (is_coarse(verdict)) {
    picture.caption.push_back(
        "waves are finer than the vertex spacing: their appearance is random");
  } else if (is_finer_than_pixel(job, pixel_mm)) {
    replace_by_form(picture.field);
    picture.caption.push_back(
        fmt::format("form: waves longer than {:.3g} mm; texture, Sz {}, is finer than a pixel",
                    job.scene.part.form_cutoff, texture_height(verdict)));
  }
  picture.datum = name_of(job.scene.datum.kind);
  picture.alignment = name_of(job.scene.alignment);
  picture.tolerance_um = verdict.tolerance / units::um;
  if (const auto& c = verdict.residual.conformance) picture.percentages = percentages(*c);
  picture.verdict = typeset_verdict(tolerance_verdict(verdict.residual.conformance, verdict.worst));
  if (const program::UnreachedPoints& u = job.unreached; u.points > 0)
    picture.caption.push_back(
        fmt::format("out of reach of the machine: {} of {} passes, parts of {}", u.passes,
                    u.all_passes, u.broken_passes));
  return picture;
}

/// Returns the change of the machine's contribution to the map by a compensator; empty for a case
/// without one.
std::string reduction_text(const ComparedCase& compared, const std::vector<ComparedCase>& cases) {
  if (!compared.uncompensated_index) return "";
  const auto& before = cases[*compared.uncompensated_index].verdict.machine_contribution;
  const auto& after = compared.verdict.machine_contribution;
  if (!before || !after || !before->rms || !after->rms || *before->rms == 0.0) return "";
  const double change = 100.0 * (*after->rms / *before->rms - 1.0);
  // A minus sign, because the line might be broken at a hyphen.
  return fmt::format("machine {} RMS, {}{:.1f} %", length_text(*after->rms),
                     change < 0.0 ? "\u2212" : "+", std::abs(change));
}

/// Returns form and texture of a case; empty if its caption already states them.
std::string form_texture_line(const Job& job, const Verdict& verdict) {
  if (shows_form_map(job, verdict) || !verdict.form_statistics || !verdict.form_statistics->pv ||
      !verdict.texture)
    return "";
  const std::string form = "form PV " + length_text(*verdict.form_statistics->pv);
  return is_finer_than_pixel(job, panel_pixel_mm(job))
             ? form
             : form + ", texture Sz " + texture_height(verdict);
}

/// Returns a time in s, or in hours from 600 s on.
std::string time_text(double time_s) {
  return std::abs(time_s) >= 600.0 ? fmt::format("{:.4g} h", time_s / 3600.0)
                                   : fmt::format("{:.4g} s", time_s);
}

/// Draws the temperatures of all nodes over history and program.
void write_temperature_picture(const std::filesystem::path& file, const Job& job) {
  const errors::ThermalRun& run = job.truth.heat->run;
  const double begin_s = run.knots.front().time_s, end_s = run.knots.back().time_s;
  constexpr int points = 600;
  // The time axis is in hours above 2 h, in minutes above 5 min.
  const double unit =
      end_s - begin_s > 2 * 3600.0 ? 3600.0 : (end_s - begin_s > 300.0 ? 60.0 : 1.0);
  std::vector<render::ProfileSeries> series;
  for (const errors::ThermalNode& node : run.network.nodes)
    series.push_back({node.name, Eigen::VectorXd(points), Eigen::VectorXd(points)});
  for (int i = 0; i < points; ++i) {
    const double time_s = begin_s + (end_s - begin_s) * i / (points - 1);
    const Eigen::VectorXd T_C = errors::temperatures(run, time_s);
    for (std::size_t k = 0; k < series.size(); ++k) {
      series[k].x[i] = time_s / unit;
      series[k].y[i] = T_C[Eigen::Index(k)];
    }
  }
  render::ProfileOptions options;
  options.title = job.scene.title + ": temperatures";
  options.x_label = unit == 3600.0 ? "time / h" : (unit == 60.0 ? "time / min" : "time / s");
  options.y_label = "temperature / °C";
  options.caption = {"time 0 is the start of the program"};
  render::write_profile(file, series, options);
}

/// Returns a time with the temperatures of the nodes on which an element depends.
std::string time_temperature_text(const Truth::Heat& heat, int joint,
                                  const errors::ElementName& name, double time_s) {
  std::set<int> nodes;
  const auto add = [&](const errors::ThermalFunction& function) {
    for (const auto& term : function.terms) {
      nodes.insert(term.node);
      if (term.minus) nodes.insert(*term.minus);
    }
  };
  for (const errors::ThermalModel::Bound& bound : heat.model.elements) {
    if (bound.joint != joint || bound.location || bound.component != name.component()) continue;
    add(bound.element.offset);
    add(bound.element.slope);
  }
  const Eigen::VectorXd T_C = errors::temperatures(heat.run, time_s);
  std::string text = time_text(time_s);
  const char* separator = ": ";
  for (const int node : nodes) {
    text += fmt::format("{}{} {:.1f}", separator, heat.run.network.nodes[std::size_t(node)].name,
                        T_C[node]);
    separator = ", ";
  }
  return nodes.empty() ? text : text + " °C";
}

/// Draws one element over its range or the travel of its axis, at several times.
void write_element_picture(const std::filesystem::path& file, const Job& job,
                           const ThermalDescription::Plot& plot) {
  const kinematics::Chain& chain = job.machine.nominal;
  auto index = chain.find(plot.element.axis);
  if (!index && plot.element.axis == 'S') index = chain.find('s');
  const int j = index.value();
  const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
  const bool is_slide = joint.motion == kinematics::Motion::Linear;
  const double full_turn = 2 * pi;
  // An unlimited axis is drawn over one turn, or over 2 m, to either side.
  const double max_position = is_slide ? 2000.0 : full_turn;
  const double from = plot.range ? plot.range->front() : std::max(joint.min, -max_position);
  const double to = plot.range ? plot.range->back() : std::min(joint.max, max_position);
  constexpr int points = 400;
  std::vector<render::ProfileSeries> series;
  for (const double time_s : plot.time_s) {
    render::ProfileSeries curve{time_temperature_text(*job.truth.heat, j, plot.element, time_s),
                                Eigen::VectorXd(points), Eigen::VectorXd(points)};
    for (int i = 0; i < points; ++i) {
      kinematics::AxisState state;
      state.q = kinematics::AxisVector::Zero(chain.size());
      state.q[j] = from + (to - from) * i / (points - 1);
      state.time_s = time_s;
      curve.x[i] = is_slide ? state.q[j] : state.q[j] / units::deg;
      try {
        const kinematics::JointDeviation deviation =
            deviations(job.truth, state).joints[std::size_t(j)];
        curve.y[i] = (plot.element.location ? deviation.location
                                            : deviation.motion)[plot.element.component()] /
                     (plot.element.is_angle() ? units::urad : units::um);
      } catch (const std::out_of_range&) {  // outside a table: the curve ends there
        curve.y[i] = std::numeric_limits<double>::quiet_NaN();
      }
    }
    series.push_back(std::move(curve));
  }
  render::ProfileOptions options;
  const std::string name = errors::to_string(plot.element);
  options.title = job.scene.title + ": " + name;
  options.x_label = fmt::format("{} / {}", plot.element.axis, is_slide ? "mm" : "°");
  options.y_label = fmt::format("{} / {}", name, plot.element.is_angle() ? "µrad" : "µm");
  options.caption = {
      "actual minus nominal, all sources, as commanded; time 0 is the start of the "
      "program"};
  render::write_profile(file, series, options);
}

const std::string element_suffix = "-temperatures.png";

/// Removes pictures of elements that an earlier run wrote and this run does not.
/// @param current  names of the pictures of this run
void remove_outdated_pictures(const ResultFolder& folder, const std::set<std::string>& current) {
  std::vector<std::string> outdated;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(element_suffix) && !current.contains(name)) outdated.push_back(name);
  }
  for (const std::string& name : outdated) remove_file(folder / name);
}

}  // namespace

bool can_draw_pictures() { return true; }

std::string font_warning(const std::string& text) {
  const std::string package = render::missing_font_package(text);
  return package.empty()
             ? ""
             : "pictures use another font, which may lack some letters: install " + package;
}

void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                         const Progress& progress) {
  const auto report_progress = [&](const char* stage, double fraction) {
    if (progress) progress(stage, fraction);
  };
  // The histogram is drawn first, because it needs only one core while another thread compresses
  // the files of the case. The map needs all cores.
  report_progress("draw", 0.0);
  write_file(folder / "histogram.png", [&](const std::filesystem::path& file) {
    render::HistogramOptions options;
    options.title = job.scene.title + ": " + verdict.cut.name;
    if (const auto& tolerance = job.scene.part.tolerance)
      options.tolerance_um = std::array{tolerance->lower / units::um, tolerance->upper / units::um};
    if (const cutting::Statistics& s = verdict.residual; s.uncut_vertices + s.gouged_vertices > 0)
      options.caption.push_back(
          fmt::format("omitted: {} of {} judged vertices uncut, {} gouged deeper than the band",
                      s.uncut_vertices, s.cut_vertices + s.uncut_vertices + s.gouged_vertices,
                      s.gouged_vertices));
    options.figures = figures(verdict.residual);
    const cutting::Surface& surface = verdict.alignment.surface;
    const cutting::Weights weights = cutting::weights(surface, job.design_w);
    Eigen::VectorXd values(surface.residual.size() + surface.within.size()), areas(values.size());
    values << surface.residual / units::um, surface.within / units::um;
    areas << weights.vertex, weights.within;
    render::write_histogram(file, values, areas, options);
  });
  report_progress("draw", 0.2);
  render::MapPicture picture = map_picture(job, verdict);
  picture.title = job.scene.title + ": " + verdict.cut.name;
  render::MapOptions map_options;
  map_options.range_um = job.scene.view.range_um;
  map_options.from = job.scene.view.from;
  map_options.up = job.scene.view.up;
  write_file(folder / "residual.png", [&](const std::filesystem::path& file) {
    render::write_map(file, picture, map_options);
  });
  map_options.colours = render::MapColours::Tolerance;
  if (picture.tolerance_um.rows() > 0)
    write_file(folder / "tolerance.png", [&](const std::filesystem::path& file) {
      render::write_map(file, picture, map_options);
    });
  else
    remove_file(folder / "tolerance.png");
}

std::string map_png(const Job& job, const Verdict& verdict, int width) {
  render::MapOptions options;
  options.width = width;
  options.height = 3 * width / 4;
  options.range_um = job.scene.view.range_um;
  options.from = job.scene.view.from;
  options.up = job.scene.view.up;
  return render::png_file(render::map_pixels(map_picture(job, verdict), options),
                          render::PngPurpose::Size);
}

/// Writes the pictures of the stock, or removes those of an earlier run if no stock was tracked.
void write_stock_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict) {
  const std::shared_ptr<const StockCheck> check =
      verdict.stock ? verdict.stock : stock_check(job, verdict);
  if (!check) {
    for (const char* name : {"stock.vtp", "stock.png"}) remove_file(folder / name);
    return;
  }
  const render::StockField field = stock_field(*check);
  write_file(folder / "stock.vtp", [&](const std::filesystem::path& file) {
    render::write_stock(file, field, stock_facts(*check));
  });
  // A blank that was cut away completely cannot be drawn.
  if (field.mesh.triangles.rows() == 0) return remove_file(folder / "stock.png");
  write_file(folder / "stock.png", [&](const std::filesystem::path& file) {
    render::write_stock_picture(file, stock_picture(job, verdict, *check, field));
  });
}

void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict) {
  write_stock_pictures(folder, job, verdict);
  const bool has_heat = job.truth.heat && verdict.cut.case_name != "error_free";
  if (has_heat)
    write_file(folder / "temperatures.png",
               [&](const std::filesystem::path& file) { write_temperature_picture(file, job); });
  else
    remove_file(folder / "temperatures.png");
  std::set<std::string> names;
  if (has_heat)
    for (const ThermalDescription::Plot& plot : job.scene.thermal->plots) {
      const std::string name = errors::to_string(plot.element) + element_suffix;
      names.insert(name);
      write_file(folder / name, [&](const std::filesystem::path& file) {
        write_element_picture(file, job, plot);
      });
    }
  remove_outdated_pictures(folder, names);
}

void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<ComparedCase>& cases, const Progress& progress) {
  if (progress) progress("compare", 0.0);
  std::vector<render::MapPicture> pictures;
  for (const ComparedCase& compared : cases) {
    const Job& job = *compared.job;
    pictures.push_back(map_picture(job, compared.verdict, panel_pixel_mm(job)));
    for (const std::string& line :
         {reduction_text(compared, cases), form_texture_line(job, compared.verdict)})
      if (!line.empty()) pictures.back().caption.push_back(line);
  }
  render::ComparisonOptions options;
  options.title = scene.title;
  options.range_um = scene.view.range_um;
  options.from = scene.view.from;
  options.up = scene.view.up;
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_comparison(temporary, pictures, options);
  });
}

void write_check_picture(const ResultFile& file, const Job& job) {
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::MachinePictureOptions options;
    // A turned part is viewed from the front.
    if (job.machine.workpiece_spindle) options.from = Eigen::Vector3d(1.0, -0.8, 0.6);
    render::write_machine_picture(temporary, machine_picture(job), options);
  });
}

void write_collision_pictures(const ResultFolder& folder, const Job& job,
                              const Collisions& collisions) {
  const ResultFile event_file = folder / "collision.png", chart_file = folder / "clearance.png";
  const Collision* event = first_event(collisions);
  if (event == nullptr)
    remove_file(event_file);
  else
    write_file(event_file, [&](const std::filesystem::path& temporary) {
      render::write_machine_picture(temporary, collision_picture(job, collisions, *event));
    });
  const render::Panel panel = clearance_panel(collisions);
  if (panel.series.empty()) return remove_file(chart_file);
  write_file(chart_file, [&](const std::filesystem::path& temporary) {
    render::CurvesOptions options;
    options.title = job.scene.title + ": minimum clearance of every block, " + collisions.commands;
    options.caption = clearance_caption(collisions);
    render::write_curves(temporary, {panel}, options);
  });
}

void write_program_picture(const ResultFile& file, const ProgramInspection& inspection) {
  write_file(file, [&](const std::filesystem::path& temporary) {
    render::write_machine_picture(temporary, machine_picture(inspection));
  });
}

}  // namespace abbe::sim

#else

namespace abbe::sim {

bool can_draw_pictures() { return false; }
std::string font_warning(const std::string&) { return ""; }

void write_case_pictures(const ResultFolder&, const Job&, const Verdict&, const Progress&) {}
std::string map_png(const Job&, const Verdict&, int) { return {}; }
void write_source_pictures(const ResultFolder&, const Job&, const Verdict&) {}
void write_comparison_picture(const ResultFile&, const Scene&, const std::vector<ComparedCase>&,
                              const Progress&) {}
void write_check_picture(const ResultFile& file, const Job&) {
  throw BadInput(file.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "a program built without VTK");
}
void write_collision_pictures(const ResultFolder& folder, const Job&, const Collisions&) {
  throw BadInput(folder.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "a program built without VTK");
}
void write_program_picture(const ResultFile& file, const ProgramInspection&) {
  throw BadInput(file.path().string(), 0, 0, "a program built with -DABBE_RENDER=ON",
                 "a program built without VTK");
}
}  // namespace abbe::sim

#endif
