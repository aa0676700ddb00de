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

/// How a key is asked for: of the nominal tool by `must`, of the actual one by `optional_actual`.
using Asked = KeyName (*)(KeyName);
KeyName optional_actual(KeyName key);
/// A key that may be left out, of the nominal tool with the fallback of its own.
KeyName left_out(Asked asked, const KeyName& key);

bool has_all_keys(const TableReader& reader, const std::vector<Key>& keys);

/// Which of the two tools of a description is meant.
struct FormSelector {
  ToolForm ToolDescription::*form;
  ToolShape ToolDescription::*shape;
  Asked asked;
};
inline constexpr FormSelector nominal_selector{&ToolDescription::nominal_form,
                                               &ToolDescription::nominal, must};
inline constexpr FormSelector actual_selector{&ToolDescription::actual_form,
                                              &ToolDescription::actual, optional_actual};

/// The cutter of APT, of an outline and of a profile. @param kind  "apt", "form" or "profile"
Fields<ToolDescription> form_cutter_fields(const std::string& kind, const FormSelector& which);
/// mm, by which a tool of this form is larger than its arcs that bulge inwards, which are cut as
/// chords.
double chord_sag(const ToolForm& form);

/// Turning tools whose edge has a profile. @param kind  "insert", a nose with two straight edges,
/// or
///                                                     "edge", free lines and arcs
Fields<ToolDescription> insert_fields(const std::string& kind, const FormSelector& which);

/// "outline: expected a, seen b" as what is expected and seen; b may be left out.
struct Refusal {
  std::string expected, seen;
};
Refusal refusal_of(const std::string& why);

/// Keys of the numbers of points: two coordinates, and the radius of the arc to each.
using PointKeys = std::array<const char*, 3>;

/// Refuses the number of the point that a fault is of, at its place in the table, or at the key
/// that it has; where the table has none of the keys, at the table.
void report_point_error(TableReader& reader, const PointKeys& keys,
                        const std::vector<cutting::OutlinePoint>& points,
                        const cutting::OutlineError& fault);

/// The keys of a form, and the tool that it makes where each of them is good. Where the description
/// is of another form one of this is begun.
/// @param refuse  says why none can be made, where the table stands
template <class Form, class Shape>
Fields<ToolDescription> fields_of_form(const FormSelector& which, const Fields<Form>& own,
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
