#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutting/surface/outline.h"
#include "sim/scene/fields.h"
#include "sim/scene/tool.h"

/// Tools whose shape is made from a form of its own: `ToolForm`.
namespace abbe::sim {

/// Mode of a key: `must` for the nominal tool, `optional_actual` for the actual one.
using Asked = KeyName (*)(KeyName);
KeyName optional_actual(KeyName key);
/// Returns a key that may be omitted; for the nominal tool it has its own fallback.
KeyName left_out(Asked asked, const KeyName& key);

bool has_all_keys(const TableReader& reader, const std::vector<Key>& keys);

/// Selects the nominal or the actual tool of a description.
struct FormSelector {
  ToolForm ToolDescription::*form;
  ToolShape ToolDescription::*shape;
  Asked asked;
};
inline constexpr FormSelector nominal_selector{&ToolDescription::nominal_form,
                                               &ToolDescription::nominal, must};
inline constexpr FormSelector actual_selector{&ToolDescription::actual_form,
                                              &ToolDescription::actual, optional_actual};

/// Returns the fields of the cutter of APT, of an outline or of a profile.
/// @param kind  "apt", "form" or "profile"
Fields<ToolDescription> form_cutter_fields(const std::string& kind, const FormSelector& which);
/// Returns the length in mm by which a tool of this form is larger than its inward arcs, which are
/// replaced by chords.
double chord_sag(const ToolForm& form);

/// Returns the fields of turning tools whose edge has a profile.
/// @param kind  "insert", a nose with two straight edges, or "edge", free lines and arcs
Fields<ToolDescription> insert_fields(const std::string& kind, const FormSelector& which);

/// The expected and the seen part of "outline: expected a, seen b"; b may be absent.
struct ExpectedAndSeen {
  std::string expected, seen;
};
ExpectedAndSeen refusal_of(const std::string& why);

/// Keys of the numbers of points: two coordinates, and the radius of the arc to each point.
using PointKeys = std::array<const char*, 3>;

/// Reports an erroneous number of a point at its position in the list, or at the key if the list
/// lacks it; without any of the keys, at the table.
void report_point_error(TableReader& reader, const PointKeys& keys,
                        const std::vector<cutting::OutlinePoint>& points,
                        const cutting::OutlineError& fault);

/// Returns the keys of a form, and makes the tool if each of them is correct. If the description
/// holds another form, a new one is begun.
/// @param refuse  reports at the table why no tool can be made
template <class Form, class Shape>
Fields<ToolDescription> form_fields(const FormSelector& which, const Fields<Form>& own,
                                    Shape (*made)(const Form&),
                                    void (*refuse)(TableReader& reader, const Form& form,
                                                   const std::invalid_argument& why)) {
  return Fields<ToolDescription>().custom(
      own.keys(),
      [=](TableReader& reader, ToolDescription& tool) {
        const std::size_t before = reader.input_errors().list().size();
        const Form* begun = std::get_if<Form>(&(tool.*which.form));
        const Form form = own.read(reader, begun ? *begun : Form{});
        tool.*which.form = form;
        if (!std::holds_alternative<Shape>(tool.*which.shape)) tool.*which.shape = Shape{};
        if (reader.input_errors().list().size() != before || !has_all_keys(reader, own.keys()))
          return;
        try {
          tool.*which.shape = made(form);
        } catch (const std::invalid_argument& why) {
          refuse(reader, form, why);
        }
      },
      [=](const ToolDescription& tool, Node::Table& table) {
        append_entries(table, own.written(std::get<Form>(tool.*which.form)));
      });
}

}  // namespace abbe::sim
