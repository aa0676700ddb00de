#pragma once

#include <array>
#include <string>
#include <vector>

#include "cutting/surface/outline.h"
#include "sim/scene/fields.h"
#include "sim/scene/tool.h"

/// Fields of tools whose shape is made from a `ToolForm`.
namespace abbe::sim {

/// Makes a key required for the nominal tool (`required_key`), or optional for the actual one
/// (`optional_actual`).
using ToolKeyFunction = KeyName (*)(KeyName);
KeyName optional_actual(KeyName key);
/// Returns a key that is optional for both tools; that of the actual tool defaults to the nominal
/// value.
KeyName optional_for_both(ToolKeyFunction tool_key, const KeyName& key);

/// Returns true if all required keys are present.
bool has_all_keys(const TableReader& reader, const std::vector<Key>& keys);

/// Selects the nominal or the actual tool of a description.
struct FormSelector {
  ToolForm ToolDescription::*form;
  ToolShape ToolDescription::*shape;
  ToolKeyFunction tool_key;
};
inline constexpr FormSelector nominal_selector{&ToolDescription::nominal_form,
                                               &ToolDescription::nominal, required_key};
inline constexpr FormSelector actual_selector{&ToolDescription::actual_form,
                                              &ToolDescription::actual, optional_actual};

/// Returns the fields of a milling cutter with a form.
/// @param kind  "apt", "form" or "profile"
Fields<ToolDescription> form_cutter_fields(const std::string& kind, const FormSelector& selector);
/// Returns the chord error in mm: inward arcs are replaced by chords, which makes the tool larger
/// by up to this length.
double chord_sag(const ToolForm& form);

/// Returns the fields of a turning tool with a form.
/// @param kind  "insert", a nose with two straight edges, or "edge", free lines and arcs
Fields<ToolDescription> insert_fields(const std::string& kind, const FormSelector& selector);

/// The two parts of an error message such as "outline: expected a, seen b".
struct ExpectedAndSeen {
  std::string expected, seen;
};
/// Returns the parts of a message. Without "seen", the second part is "other numbers"; without
/// "expected", the first part is the whole text.
ExpectedAndSeen parse_message(const std::string& message);

/// Keys of the lists of points: two coordinates, and the radius of the arc to each point.
using PointKeys = std::array<const char*, 3>;

/// Reports an invalid point at its entry in the list; at the table if the list has no such entry.
void report_point_error(TableReader& reader, const PointKeys& keys,
                        const std::vector<cutting::OutlinePoint>& points,
                        const cutting::OutlineError& error);

}  // namespace abbe::sim
