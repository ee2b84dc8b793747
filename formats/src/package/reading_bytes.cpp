#include "formats/src/package/reading_bytes.h"

#include <algorithm>

#include "formats/src/package/layout.h"
#include "formats/src/package/refusal.h"

namespace figurine {
namespace {

// For messages, and what there is one of.
constexpr uint64_t kBase = 48 << 10;
// Of what has a table in the index: a blob is an entry of two lists and of two trees by its name, a
// member two structs of half a kilobyte each and a node, a layer its struct and its shapes.
constexpr uint64_t kOfTable = 2 << 10;
// Of a text, beside its bytes: its string, in a list that grows twofold, and its memory.
constexpr uint64_t kOfText = 256;
constexpr uint64_t kOfNumber = 32;  // of one in a list that grows twofold

uint64_t of(const flatbuffers::String* text) {
  // Twice: a member's settings are read as texts before they are pairs.
  return text == nullptr ? 0 : kOfText + 2 * uint64_t{text->size()};
}

// A list longer than its limit is refused before it is read.
template <class List, class Of>
uint64_t of_list(const List* list, Of of_entry) {
  if (list == nullptr || list->size() > layout::kMaxListEntries) return 0;
  uint64_t bytes = 0;
  for (uint32_t i = 0; i < list->size(); ++i) bytes += of_entry(list->Get(i));
  return bytes;
}

uint64_t of_texts(const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>* list) {
  return of_list(list, [](const flatbuffers::String* text) { return of(text); });
}

// Table: schema::Provenance or schema::Member, whose texts of one name are one thing.
template <class Table>
uint64_t of_origin(const Table& table) {
  uint64_t bytes = of_texts(table.sources()) + of_texts(table.authors());
  for (const flatbuffers::String* text :
       {table.tool(), table.created(), table.licence_name(), table.licence_url(),
        table.avatar_permission(), table.commercial_usage(), table.depicted_person()}) {
    bytes += of(text);
  }
  return bytes;
}

uint64_t of_provenance(const schema::Provenance& table) {
  return of_origin(table) +
         of_list(
             table.settings(),
             [](const schema::Setting* entry) { return of(entry->key()) + of(entry->value()); }) +
         of_list(table.quality(),
                 [](const schema::QualityMetric* entry) { return of(entry->name()); });
}

template <class List>
uint64_t of_tables(const List* list) {
  return list == nullptr ? 0 : kOfTable * list->size();
}

template <class List>
uint64_t of_numbers(const List* list) {
  return list == nullptr ? 0 : kOfNumber * list->size();
}

uint64_t of_golden(const schema::GoldenFrame* golden) {
  return golden == nullptr ? 0 : of(golden->fixed_point_library());
}

uint64_t of_content(const schema::Body& body) { return 2 * of_texts(body.joint_names()); }
uint64_t of_content(const schema::Motion& motion) { return 2 * of_texts(motion.joint_names()); }

uint64_t of_content(const schema::Avatar& avatar) {
  return of_tables(avatar.network()->layers()) + of_tables(avatar.static_groups()) +
         of_golden(avatar.golden()) +
         (avatar.fixed_point() == nullptr ? 0 : of_numbers(avatar.fixed_point()->values()));
}

uint64_t of_content(const schema::Population& population) {
  const uint64_t figures =
      population.quality_names() == nullptr ? 0 : population.quality_names()->size();
  uint64_t bytes = of_tables(population.network()->layers()) +
                   of_tables(population.static_groups()) + of_texts(population.quality_names());
  for (const schema::Member* member : *population.members()) {
    bytes += kOfTable + of_origin(*member) + of(member->name()) + of_texts(member->settings()) +
             of_golden(member->golden()) + figures * sizeof(double);
  }
  return bytes;
}

uint64_t of_content(const schema::Sampler& sampler) {
  uint64_t bytes = of_tables(sampler.network()->layers()) + of_tables(sampler.golden_seeds()) +
                   of_tables(sampler.static_groups()) + of_numbers(sampler.values()) +
                   of_numbers(sampler.ranks()) + of_golden(sampler.golden());
  if (sampler.static_groups() == nullptr) return bytes;
  for (const schema::SampledStaticGroup* group : *sampler.static_groups())
    bytes += of_numbers(group->patch_rows());
  return bytes;
}

}  // namespace

Result<uint64_t> find_reading_bytes(const schema::Index& index) {
  uint64_t bytes =
      kBase + of(index.name()) + of_provenance(*index.provenance()) + of_tables(index.blobs());
  if (const schema::Body* body = index.content_as_Body()) bytes += of_content(*body);
  if (const schema::Motion* motion = index.content_as_Motion()) bytes += of_content(*motion);
  if (const schema::Avatar* avatar = index.content_as_Avatar()) bytes += of_content(*avatar);
  if (const schema::Population* all = index.content_as_Population()) bytes += of_content(*all);
  if (const schema::Sampler* sampler = index.content_as_Sampler()) bytes += of_content(*sampler);
  if (bytes > layout::kMaxReadingBytes) {
    return over_limit("index", "its texts and lists take ", bytes, " bytes, at most ",
                      layout::kMaxReadingBytes);
  }
  return bytes;
}

}  // namespace figurine
