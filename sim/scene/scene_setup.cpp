#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

using kinematics::Deviation;

Fields<DatumDescription::Touch> touch_fields() {
  using Touch = DatumDescription::Touch;
  return Fields<Touch>()
      .vector(must("point_mm"), &Touch::point_w, "where it touches, in the workpiece frame")
      .direction(must("direction"), &Touch::direction_w,
                 "in which the probe moves, towards the face");
}

/// An instant, negative in the thermal history before the program.
Fields<DatumDescription> time_fields() {
  Key hours = key_of("time_h", Key::Kind::Number, "the same in hours");
  return Fields<DatumDescription>()
      .number("time_s", &DatumDescription::time_s, any_number,
              "when it was found, negative before the program; with heat, drift counts from there")
      .custom(
          {hours},
          [](TableReader& reader, DatumDescription& datum) {
            const auto time_s = reader.maybe_number("time_h", any_number);
            if (!reader.has("time_h")) return;
            if (reader.has("time_s")) reader.refuse("time_h", "one of time_s and time_h", "both");
            datum.time_s = time_s.value_or(1.0);
          },
          [](const DatumDescription&, Node::Table&) {});
}

Fields<DatumDescription> datum_fields_of(DatumDescription::Kind kind) {
  Fields<DatumDescription> fields;
  if (kind == DatumDescription::Kind::Ideal)
    fields.vector("point_mm", &DatumDescription::point_w,
                  "where the tip is set exactly, in the workpiece frame");
  if (kind != DatumDescription::Kind::None) fields.all_of(itself, time_fields());
  if (kind == DatumDescription::Kind::TouchOff)
    fields.tables(
        must("touch"), &DatumDescription::touches, touch_fields(),
        "touches of the probe, each of the part, its blank, a fixture or the table within "
        "`search.band_mm`, at most 40 degrees from straight against its face");
  return fields;
}

}  // namespace

const Fields<Deviation>& setup_fields() {
  static const Fields<Deviation> fields = [] {
    Fields<Deviation> all;
    const auto part = [](int i) {
      return [i](auto& setup) -> auto& { return setup[i]; };
    };
    const char* names[] = {"EX_um", "EY_um", "EZ_um", "EA_urad", "EB_urad", "EC_urad"};
    for (int i = 0; i < 6; ++i)
      all.number(KeyName(names[i]).otherwise("0"), part(i), any_number,
                 i < 3 ? "displacement of the part, actual minus nominal"
                       : "rotation of the part, actual minus nominal");
    return all;
  }();
  return fields;
}

const Fields<DatumDescription>& datum_fields() {
  static const Fields<DatumDescription> fields = [] {
    Key kind = key_of(must("kind"), Key::Kind::Text, "how the control finds the part");
    const std::vector<std::pair<DatumDescription::Kind, Word>> kinds{
        {DatumDescription::Kind::None, {"none", "not at all: where it should be", {}}},
        {DatumDescription::Kind::Ideal, {"ideal", "the tip is set exactly at one point", {}}},
        {DatumDescription::Kind::TouchOff,
         {"touch_off", "by a probe with the machine's errors", {}}}};
    for (auto [one, word] : kinds) {
      word.keys = datum_fields_of(one).keys();
      kind.words.push_back(std::move(word));
    }
    return Fields<DatumDescription>().custom(
        {kind},
        [kind, kinds](TableReader& reader, DatumDescription& datum) {
          const auto word = reader.word("kind", words_of(kind), true);
          for (const auto& [one, named] : kinds)
            if (word == named.word) datum.kind = one;
          datum = datum_fields_of(datum.kind).read(reader, datum);
        },
        [kinds](const DatumDescription& datum, Node::Table& table) {
          for (const auto& [one, named] : kinds)
            if (datum.kind == one) put(table, "kind", named.word);
          for (Node::Entry& entry : datum_fields_of(datum.kind).written(datum))
            table.push_back(std::move(entry));
        });
  }();
  return fields;
}

}  // namespace abbe::sim
