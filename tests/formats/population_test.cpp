// Populations: what goes in comes out to within the coding's rounding, what does not belong
// together is refused, and packages whose bytes are whole but whose numbers cannot be true are no
// populations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>

#include "figurine/detail/half.h"
#include "figurine/detail/rans.h"
#include "formats/opened.h"
#include "formats/package_bytes.h"
#include "formats/package_samples.h"
#include "formats/refusals.h"
#include "formats/writer/package_parts.h"
#include "formats/writer/rans_encoder.h"

namespace figurine::population_test {
namespace {

using samples::AvatarSample;
using samples::ExactBytes;
using samples::expect_refused;
using samples::open_or_die;
using samples::Opened;
using samples::PopulationSample;
using samples::same;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// ---- Halves -------------------------------------------------------------------------------------

TEST(Half, EveryOneComesBackThroughFloat) {
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    const Half half{static_cast<uint16_t>(bits)};
    const float value = to_float(half);
    EXPECT_EQ(is_finite(half), std::isfinite(value)) << bits;
    if (std::isnan(value)) {
      EXPECT_FALSE(is_finite(to_half(value)));
    } else {
      EXPECT_EQ(to_half(value).bits, half.bits) << bits;
    }
  }
}

TEST(Half, KnownValues) {
  const std::pair<float, uint16_t> known[] = {
      {0.0f, 0x0000},     {-0.0f, 0x8000},    {1.0f, 0x3C00},      {-2.0f, 0xC000},
      {65504.0f, 0x7BFF}, {0x1p-14f, 0x0400}, {0x1p-24f, 0x0001},  {0x1p-26f, 0x0000},
      {65519.0f, 0x7BFF}, {65520.0f, 0x7C00}, {kInfinity, 0x7C00}, {-kInfinity, 0xFC00}};
  for (const auto& [value, bits] : known) EXPECT_EQ(to_half(value).bits, bits) << value;
}

TEST(Half, RoundsToNearestTiesToEven) {
  for (uint32_t bits = 0; bits < 0x7BFF;
       ++bits) {  // every two neighbours: below, at and above their middle
    const float low = to_float({static_cast<uint16_t>(bits)}),
                high = to_float({static_cast<uint16_t>(bits + 1)});
    const float middle = low + (high - low) / 2;
    EXPECT_EQ(to_half(middle).bits, bits + (bits & 1)) << bits;
    EXPECT_EQ(to_half(std::nextafter(middle, 0.0f)).bits, bits) << bits;
    EXPECT_EQ(to_half(std::nextafter(middle, kInfinity)).bits, bits + 1) << bits;
  }
}

// ---- Entropy coding -----------------------------------------------------------------------------

std::vector<int8_t> decode(std::span<const uint8_t> stream, const RansTable& table, size_t count) {
  RansDecoder decoder(stream);
  std::vector<int8_t> values;
  for (size_t i = 0; i < count; ++i) values.push_back(static_cast<int8_t>(decoder.next(table)));
  return values;
}

RansTable table_of(const std::vector<int8_t>& values) {
  std::array<uint64_t, kRansValues> counts{};
  for (const int8_t value : values) ++counts[static_cast<size_t>(value + 127)];
  return RansTable(normalise_counts(counts));
}

// Two-sided geometric, as differences of weights about are.
std::vector<int8_t> laplacian(size_t count, double decay) {
  std::vector<int8_t> values;
  uint64_t state = 1;
  const auto uniform = [&] {
    return static_cast<double>((state = state * 6364136223846793005u + 1442695040888963407u) >>
                               40) *
           0x1p-24;
  };
  while (values.size() < count) {
    int magnitude = 0;
    while (magnitude < 127 && uniform() < decay) ++magnitude;
    values.push_back(static_cast<int8_t>(uniform() < 0.5 ? -magnitude : magnitude));
  }
  return values;
}

TEST(Rans, DecodesWhatWasEncoded) {
  std::vector<int8_t> all;
  for (int v = -127; v <= 127; ++v) all.push_back(static_cast<int8_t>(v));
  for (const std::vector<int8_t>& values : {std::vector<int8_t>{},
                                            {0},
                                            {-127},
                                            {127, -127},
                                            std::vector<int8_t>(1000, 5),
                                            all,
                                            laplacian(20000, 0.97),
                                            laplacian(20000, 0.2)}) {
    const RansTable table = table_of(values);
    const RansStretch stretch[] = {{values, &table}};
    EXPECT_EQ(decode(encode_rans(stretch), table, values.size()), values);
  }
}

TEST(Rans, SeveralTablesShareAStream) {
  const std::vector<int8_t> wide = laplacian(3000, 0.95), narrow = laplacian(1000, 0.1);
  const RansTable a = table_of(wide), b = table_of(narrow);
  const RansStretch stretches[] = {{wide, &a}, {narrow, &b}, {wide, &a}};
  const std::vector<uint8_t> stream = encode_rans(stretches);
  RansDecoder decoder(stream);
  for (const RansStretch& stretch : stretches) {
    for (const int8_t value : stretch.values) ASSERT_EQ(decoder.next(*stretch.table), value);
  }
}

TEST(Rans, CostsLittleMoreThanTheEntropy) {
  const std::vector<int8_t> values = laplacian(100000, 0.95);
  std::array<double, 255> counts{};
  for (const int8_t value : values) ++counts[static_cast<size_t>(value + 127)];
  double bits = 0;
  for (const double count : counts)
    bits -= count == 0 ? 0 : count * std::log2(count / double(values.size()));
  const RansTable table = table_of(values);
  const RansStretch stretch[] = {{values, &table}};
  const double coded = 8.0 * double(encode_rans(stretch).size());
  std::printf("  %.4f bits a value, entropy %.4f\n", coded / double(values.size()),
              bits / double(values.size()));
  EXPECT_LT(coded, 1.01 * bits);
}

TEST(Rans, MakesValuesOfAnyBytes) {
  const RansTable table = table_of(laplacian(1000, 0.9));
  const std::vector<std::vector<uint8_t>> streams = {{},
                                                     {0},
                                                     {0, 0, 0, 0},
                                                     std::vector<uint8_t>(100, 0),
                                                     std::vector<uint8_t>(100, 255),
                                                     {1, 2, 3, 4, 5, 6, 7}};
  for (const std::vector<uint8_t>& bytes : streams) {
    const ExactBytes exact(std::as_bytes(std::span(bytes)));
    const std::span<const uint8_t> stream(reinterpret_cast<const uint8_t*>(exact.bytes().data()),
                                          bytes.size());
    for (const int8_t value : decode(stream, table, 10000)) ASSERT_GE(value, -127);
  }
}

TEST(Rans, FrequenciesKeepEveryValueAndTheirSum) {
  std::array<uint64_t, kRansValues> counts{};
  counts.fill(1);
  counts[3] = uint64_t{1} << 50;
  counts[7] = 0;
  const std::array<int16_t, kRansValues> frequency = normalise_counts(counts);
  int sum = 0;
  for (size_t k = 0; k < kRansValues; ++k) {
    EXPECT_EQ(frequency[k] > 0, counts[k] > 0) << k;
    sum += frequency[k];
  }
  EXPECT_EQ(sum, int(kRansTotal));
}

// ---- Round trips --------------------------------------------------------------------------------

TEST(PopulationRoundTrip, MembersKeepWhatIsNotRounded) {
  for (const DifferenceCoding coding : {DifferenceCoding::kInt8, DifferenceCoding::kHalf}) {
    const PopulationSample sample(coding);
    const Opened opened = open_or_die(sample.write());
    const Population& population = opened.package.population();
    EXPECT_EQ(population.name, "sample population");
    EXPECT_EQ(population.coding, coding);
    ASSERT_EQ(population.size(), 3u);
    std::vector<float> storage(member_floats(population));
    for (size_t m = 0; m < 3; ++m) {
      const Avatar in = sample.avatars[m]->avatar, out = open_member(population, m, storage);
      EXPECT_EQ(in.name, out.name);
      EXPECT_EQ(in.body_name, out.body_name);
      EXPECT_EQ(in.body_hash, out.body_hash);
      EXPECT_EQ(in.preset, out.preset);
      EXPECT_EQ(in.template_mode, out.template_mode);
      EXPECT_EQ(in.fourier_octaves, out.fourier_octaves);
      EXPECT_EQ(in.map_statistics.mean, out.map_statistics.mean);
      EXPECT_EQ(in.map_statistics.scale, out.map_statistics.scale);
      EXPECT_EQ(in.decoding.spacing_scale, out.decoding.spacing_scale);
      EXPECT_EQ(in.decoding.sh_degree, out.decoding.sh_degree);
      EXPECT_TRUE(same(in.shape, out.shape));
      EXPECT_TRUE(same(in.pose_statistics.mean, out.pose_statistics.mean));
      EXPECT_EQ(in.pose_statistics.joints, out.pose_statistics.joints);
      EXPECT_TRUE(same(in.golden.rotations, out.golden.rotations));
      EXPECT_EQ(in.golden.camera.cx_px, out.golden.camera.cx_px);
      EXPECT_EQ(in.golden.root_translation_m, out.golden.root_translation_m);
      EXPECT_TRUE(out.golden.png.empty());
      EXPECT_TRUE(out.holds(Precision::kFloat32));
      EXPECT_FALSE(out.holds(Precision::kFixedPoint));
      for (size_t i = 0; i < in.network.layers.size(); ++i)
        EXPECT_TRUE(same(in.network.layers[i].bias, out.network.layers[i].bias));
      for (size_t k = 0; k < 9; ++k)
        EXPECT_NEAR(in.pose_statistics.covariance[k], out.pose_statistics.covariance[k], 1e-3f);
      EXPECT_EQ(population.members[m].split, static_cast<Split>(m));
    }
  }
}

// Members come back as the header states, with so many levels on either side of zero.
void expect_stated_arithmetic(uint32_t levels) {
  PopulationSample sample;
  sample.population.levels = levels;
  const Opened opened = open_or_die(sample.write());
  const Population& population = opened.package.population();
  std::vector<float> storage(member_floats(population));
  double worst = 0;
  for (size_t m = 0; m < 3; ++m) {
    const Avatar out = open_member(population, m, storage);
    size_t row = 0;
    for (size_t i = 0; i < out.network.layers.size(); ++i) {
      const std::span<const float> initial = sample.initial->avatar.network.layers[i].weights,
                                   in = sample.avatars[m]->weights[i];
      if (in.empty()) continue;
      const size_t rows = out.network.layers[i].out_channels, size = in.size() / rows;
      for (size_t o = 0; o < rows; ++o, ++row) {
        float largest = 0;
        for (size_t k = o * size; k < (o + 1) * size; ++k)
          largest = std::max(largest, std::fabs(in[k] - initial[k]));
        const float scale =
            std::max(largest / static_cast<float>(levels), std::numeric_limits<float>::min());
        EXPECT_EQ(scale, population.scale[m * population.scale.size() / 3 + row]);
        for (size_t k = o * size; k < (o + 1) * size; ++k) {
          const float q = std::nearbyint((in[k] - initial[k]) / scale);
          ASSERT_EQ(out.network.layers[i].weights[k], initial[k] + scale * q)
              << "layer " << i << ", weight " << k;
          worst =
              std::max(worst, double(std::fabs(out.network.layers[i].weights[k] - in[k]) / scale));
        }
      }
    }
  }
  std::printf("  %u levels: largest error %.4f steps\n", levels, worst);
  EXPECT_LE(worst, 0.5 + 1e-3);
}

TEST(PopulationRoundTrip, WeightsAreTheStatedArithmetic) {
  for (const uint32_t levels : {127u, 80u, 1u}) expect_stated_arithmetic(levels);
}

// Of the streams themselves: the file's alignment hides a few bytes of so small a population.
TEST(PopulationWriter, FewerLevelsTakeFewerBytes) {
  PopulationSample coarse;
  coarse.population.levels = 32;
  const Opened few = open_or_die(coarse.write()), many = open_or_die(PopulationSample().write());
  EXPECT_LT(few.package.population().code.size(), many.package.population().code.size());
}

TEST(PopulationRoundTrip, HalvesAreExactWhereTheDifferenceIs) {
  const PopulationSample sample(DifferenceCoding::kHalf);  // differences are multiples of 2^-10
  const Opened opened = open_or_die(sample.write());
  std::vector<float> storage(member_floats(opened.package.population()));
  for (size_t m = 0; m < 3; ++m) {
    const Avatar out = open_member(opened.package.population(), m, storage);
    for (size_t i = 0; i < out.network.layers.size(); ++i) {
      EXPECT_TRUE(same(out.network.layers[i].weights,
                       std::span<const float>(sample.avatars[m]->weights[i])));
    }
  }
}

TEST(PopulationRoundTrip, MembersAreAvatarPackages) {
  const PopulationSample sample;
  const Opened opened = open_or_die(sample.write());
  std::vector<float> storage(member_floats(opened.package.population()));
  const Avatar member = open_member(opened.package.population(), 1, storage);
  const Opened alone = open_or_die(
      write_package(member, sample.initial->budget, opened.package.member_provenance(1)));
  EXPECT_TRUE(
      same(member.network.layers[0].weights, alone.package.avatar().network.layers[0].weights));
}

TEST(PopulationRoundTrip, ProvenanceIsSaidOnceAndWholeForEachMember) {
  const PopulationSample sample;
  const Opened opened = open_or_die(sample.write());
  EXPECT_EQ(opened.package.provenance().settings.size(), 2u);
  EXPECT_EQ(opened.package.provenance().tool, "figurine-tests 1");
  EXPECT_EQ(opened.package.provenance().licence_name, "");  // the third member's is another
  for (size_t m = 0; m < 3; ++m) {
    const Provenance whole = opened.package.member_provenance(m);
    const Provenance& in = sample.provenance[m];
    EXPECT_EQ(whole.licence_name, in.licence_name);
    EXPECT_EQ(whole.authors, in.authors);
    EXPECT_EQ(whole.sources, in.sources);
    EXPECT_EQ(whole.depicted_person, in.depicted_person);
    ASSERT_EQ(whole.settings.size(), 3u);
    EXPECT_EQ(whole.settings[2].key, "data.seed");
    EXPECT_EQ(whole.settings[2].value, std::to_string(m));
    ASSERT_EQ(whole.quality.size(), in.quality.size());
    for (size_t k = 0; k < in.quality.size(); ++k)
      EXPECT_EQ(whole.quality[k].value, in.quality[k].value);
  }
}

TEST(PopulationRoundTrip, SameInputGivesSameBytes) {
  EXPECT_EQ(*PopulationSample().write(), *PopulationSample().write());
}

TEST(PopulationMembers, AreFoundByNameThenByNumber) {
  PopulationSample sample;
  sample.avatars[2]->avatar.name = "1";  // a name goes before a number
  const Opened opened = open_or_die(sample.write());
  const Population& population = opened.package.population();
  EXPECT_EQ(find_member(population, "000001"), 1u);
  EXPECT_EQ(find_member(population, "0"), 0u);
  EXPECT_EQ(find_member(population, "1"), 2u);
  for (const char* none : {"", "3", "00000", "-1", "1 ", "+1", "99999999999999999999999", "zoe"}) {
    EXPECT_EQ(find_member(population, none).has_value(), std::string(none) == "00000")
        << none;  // five zeros are the number 0
  }
}

// ---- Members that do not belong together --------------------------------------------------------

Status bent(const std::function<void(PopulationSample&)>& bend,
            DifferenceCoding coding = DifferenceCoding::kInt8) {
  PopulationSample sample(coding);
  bend(sample);
  return sample.write().status();
}

TEST(PopulationWriter, NamesTheMemberThatDiffers) {
  const auto refused = [](const std::string& words, const std::function<void(Avatar&)>& bend) {
    expect_refused(bent([&](PopulationSample& s) { bend(s.avatars[1]->avatar); }),
                   "member '000001': " + words, StatusCode::kMismatch);
  };
  refused("was made for the body 'sample body'", [](Avatar& a) { a.body_hash[0] ^= 1; });
  refused("its network has another shape", [](Avatar& a) { a.network.layers[0].relu = false; });
  refused("its network has another shape", [](Avatar& a) { a.network.input_size = 16; });
  refused("has its Gaussians on another template",
          [](Avatar& a) { a.template_mode = TemplateMode::kMean; });
  refused("has 2 Fourier octaves, '000000' has 1", [](Avatar& a) { a.fourier_octaves = 2; });
  refused("has 1 shape coefficients", [](Avatar& a) { a.shape = a.shape.first(1); });
  refused("its pose statistics list other joints",
          [](Avatar& a) { a.pose_statistics.joints = {1}; });
  refused("its golden pose has 2 joints",
          [](Avatar& a) { a.golden.rotations = a.golden.rotations.first(8); });
  refused("holds no float weights", [](Avatar& a) {
    for (Layer& layer : a.network.layers) layer.weights = layer.bias = {};
  });
  expect_refused(bent([](PopulationSample& s) { s.population.members.clear(); }), "has no members",
                 StatusCode::kInvalidArgument);
  for (const uint32_t levels : {0u, 128u}) {
    expect_refused(bent([&](PopulationSample& s) { s.population.levels = levels; }), "levels",
                   StatusCode::kInvalidArgument);
  }
  expect_refused(bent([](PopulationSample& s) { s.population.initial.layers[0].weights = {}; }),
                 "initial weights", StatusCode::kInvalidArgument);
  expect_refused(bent([](PopulationSample& s) { s.avatars[1]->weights[0][0] = 1e6f; },
                      DifferenceCoding::kHalf),
                 "too large for 16 bits", StatusCode::kLimitExceeded);
}

TEST(PopulationWriter, CanBeInterrupted) {
  size_t calls = 0;
  expect_refused(bent([&](PopulationSample& s) {
                   s.population.progress = [&](size_t done) { return calls = done, done < 2; };
                 }),
                 "interrupted", StatusCode::kInterrupted);
  EXPECT_EQ(calls, 2u);
}

// ---- Numbers that cannot be true ----------------------------------------------------------------

// The status of a population after something was done to the parts that it is assembled from.
Status bent_parts(
    const std::function<void(PackageParts&, Population&, std::vector<Provenance>&)>& bend,
    DifferenceCoding coding = DifferenceCoding::kInt8) {
  const PopulationSample sample(coding);
  const Opened opened = open_or_die(sample.write());
  Population population = opened.package.population();
  std::vector<Provenance> own(population.size());
  PackageParts parts =
      *take_apart(population, opened.package.budget(), opened.package.provenance(), own);
  bend(parts, population, own);
  const ExactBytes bytes(assemble(parts));
  return Package::open(bytes.bytes(), "bent.fgn").status();
}

Status with_index(const std::function<void(Population&)>& bend) {
  return bent_parts(
      [&](PackageParts&, Population& population, std::vector<Provenance>&) { bend(population); });
}

// A blob with its bytes changed, or of another shape.
Status with_blob(const std::string& name,
                 const std::function<void(BlobPart&, std::vector<std::byte>&)>& bend,
                 DifferenceCoding coding = DifferenceCoding::kInt8) {
  std::vector<std::byte> bytes;
  return bent_parts(
      [&](PackageParts& parts, Population&, std::vector<Provenance>&) {
        const auto blob = std::ranges::find(parts.blobs, name, &BlobPart::name);
        FIG_CHECK(blob != parts.blobs.end(), name.c_str());
        bytes.assign(blob->bytes.begin(), blob->bytes.end());
        bend(*blob, bytes);
        blob->bytes = bytes;
      },
      coding);
}

template <class T>
Status with_value(const std::string& name, size_t index, T value,
                  DifferenceCoding coding = DifferenceCoding::kInt8) {
  return with_blob(
      name,
      [&](BlobPart&, std::vector<std::byte>& bytes) {
        std::memcpy(bytes.data() + index * sizeof(T), &value, sizeof(T));
      },
      coding);
}

TEST(PackagePopulation, IsSoundBeforeItIsBent) {
  EXPECT_TRUE(with_index([](Population&) {}).ok());
  EXPECT_TRUE(with_value("population.scale", 0, 0.5f).ok());
}

TEST(PackagePopulation, RejectsScalesThatAreNoneAndFrequenciesThatAreNotWhole) {
  for (const float value : {0.0f, -1.0f, kNan, kInfinity, 1e-40f, 1e37f}) {
    expect_refused(with_value("population.scale", 7, value), "population.scale: value 7");
  }
  expect_refused(with_value<int16_t>("population.frequency", 255 + 3, -1),
                 "population.frequency: value 258 is negative");
  expect_refused(with_value<int16_t>("population.frequency", 255, 5000),
                 "population.frequency: row 1 has the sum");
}

TEST(PackagePopulation, RejectsStreamsThatReachPastTheEndOrBack) {
  expect_refused(with_value("population.code_end", 2, UINT32_MAX), "population.code_end");
  expect_refused(with_value("population.code_end", 1, UINT32_MAX), "population.code_end");
  expect_refused(with_value("population.code_end", 2, 1u), "population.code_end");
  EXPECT_TRUE(
      with_value("population.code_end", 0, 0u).ok());  // a member without bytes is some member
}

TEST(PackagePopulation, RejectsNumbersThatAreNotFinite) {
  for (const float value : {kNan, kInfinity, -kInfinity}) {
    expect_refused(with_value("initial.0.weights", 3, value),
                   "initial.0.weights: value 3 is not finite");
    expect_refused(with_value("population.bias", 5, value),
                   "population.bias: value 5 is not finite");
    expect_refused(with_value("population.shape", 1, value), "population.shape: value 1");
    expect_refused(with_value("pose.mean", 8, value), "pose.mean: value 8");
    expect_refused(with_value("golden.rotations", 12, value), "population.members[1]: golden");
  }
  expect_refused(with_value("initial.0.weights", 3, 2e38f), "initial.0.weights: value 3 is larger");
  for (const uint16_t bits : {0x7C00, 0xFC00, 0x7E00}) {
    expect_refused(with_value("pose.factor", 4, bits), "pose.factor: value 4 is not finite");
    expect_refused(with_value("population.difference", 9, bits, DifferenceCoding::kHalf),
                   "population.difference: value 9 is not finite");
  }
}

TEST(PackagePopulation, RejectsFactorsOfNoCovariance) {
  expect_refused(with_value<uint16_t>("pose.factor", 6, 0),
                 "pose.factor: member 1");  // a row of zeros
  expect_refused(with_value<uint16_t>("pose.factor", 5, 0x7BFF),
                 "pose.factor: member 0");  // a variance of 4e9
}

TEST(PackagePopulation, RejectsBlobsOfOtherShapesAndCounts) {
  const auto reshaped = [](const std::string& name, const std::vector<uint32_t>& shape,
                           DifferenceCoding coding = DifferenceCoding::kInt8) {
    return with_blob(
        name,
        [&](BlobPart& blob, std::vector<std::byte>& bytes) {
          blob.shape = shape;
          uint64_t size = size_bytes(blob.type);
          for (const uint32_t length : shape) size *= length;
          bytes.resize(size);
        },
        coding);
  };
  expect_refused(reshaped("population.bias", {2, 51}), "population.bias: has shape [2,51]");
  expect_refused(reshaped("population.scale", {4, 51}), "population.scale: has shape [4,51]");
  expect_refused(reshaped("population.frequency", {14, 255}),
                 "population.frequency: has shape [14,255]");
  expect_refused(reshaped("population.frequency", {15, 256}),
                 "population.frequency: has shape [15,256]");
  expect_refused(reshaped("population.code_end", {2}), "population.code_end: has shape [2]");
  expect_refused(reshaped("population.shape", {1, 6}), "population.shape: has shape [1,6]");
  expect_refused(reshaped("population.shape", {3, 65}), "population.shape: has more than 64",
                 StatusCode::kLimitExceeded);
  expect_refused(reshaped("pose.mean", {3, 4}), "pose.mean: has shape [3,4]");
  expect_refused(reshaped("pose.factor", {3, 9}), "pose.factor: has shape [3,9]");
  expect_refused(reshaped("golden.rotations", {2, 3, 4}), "golden.rotations: has shape [2,3,4]");
  expect_refused(reshaped("population.difference", {3, 1}, DifferenceCoding::kHalf),
                 "population.difference: has shape [3,1]");
  expect_refused(
      with_blob("population.scale",
                [](BlobPart& blob, std::vector<std::byte>&) { blob.type = DataType::kI32; }),
      "population.scale: is i32, not f32");
  expect_refused(with_blob(
                     "population.difference",
                     [](BlobPart& blob, std::vector<std::byte>&) { blob.type = DataType::kI16; },
                     DifferenceCoding::kHalf),
                 "population.difference: is i16, not f16");
  for (const char* name : {"initial.0.weights", "initial.1.bias", "population.bias",
                           "population.scale", "population.frequency", "population.code",
                           "population.code_end", "pose.mean", "pose.factor", "golden.rotations"}) {
    expect_refused(bent_parts([&](PackageParts& parts, Population&, std::vector<Provenance>&) {
                     std::erase_if(parts.blobs,
                                   [&](const BlobPart& blob) { return blob.name == name; });
                   }),
                   std::string(name) + ": is missing");
  }
}

TEST(PackagePopulation, RejectsMembersThatAreNone) {
  expect_refused(with_index([](Population& p) { p.members[2].name = "000001"; }),
                 "population.members[2]: '000001' is there twice");
  expect_refused(with_index([](Population& p) { p.members[2].name = ""; }),
                 "population.members[2]: name: is empty");
  expect_refused(with_index([](Population& p) { p.members[2].name = "a#b"; }),
                 "population.members[2]: name: has a '#'");
  expect_refused(with_index([](Population& p) { p.members[0].name = "a\x1B[2J"; }),
                 "population.members[0]: name: is not UTF-8");
  expect_refused(with_index([](Population& p) { p.members[1].split = static_cast<Split>(3); }),
                 "population.members[1]: split", StatusCode::kUnsupported);
  expect_refused(with_index([](Population& p) { p.members[1].decoding.sh_degree = 0; }),
                 "population.members[1]: network: the result has");
  expect_refused(with_index([](Population& p) { p.members[1].decoding.spacing_scale = kNan; }),
                 "population.members[1]: avatar.decoding");
  expect_refused(with_index([](Population& p) { p.members[1].map_statistics.scale[2] = 0; }),
                 "population.members[1]: avatar.map_statistics");
  expect_refused(with_index([](Population& p) { p.members[1].golden.camera.fx_px = 0; }),
                 "population.members[1]: golden");
  expect_refused(with_index([](Population& p) { p.members[1].golden.rotations = {}; }),
                 "population.members[1]: a golden pose");
  expect_refused(with_index([](Population& p) { p.members[1].quality.pop_back(); }),
                 "population.members[1]: quality: has 1 figures for 2");
  expect_refused(with_index([](Population& p) { p.members[1].quality[0] = kInfinity; }),
                 "population.members[1]: quality: a figure is infinite");
  const auto members = [](size_t count) {
    return bent_parts(
        [&](PackageParts& parts, Population& population, std::vector<Provenance>& own) {
          const PopulationMember first = population.members[0];
          population.members.clear();
          for (size_t m = 0; m < count; ++m) {
            population.members.push_back(first);
            population.members.back().name = std::to_string(m);
          }
          own.resize(count);
          parts.member_provenance = own;
        });
  };
  expect_refused(members(0), "population.members: there is none");
  expect_refused(members(4), "population.bias: has shape [3,51], expected [4,51]");
  expect_refused(members(kMaxMembers + 1), "population.members: has more than 1024",
                 StatusCode::kLimitExceeded);
}

TEST(PackagePopulation, RejectsSharedFieldsThatCannotBe) {
  expect_refused(with_index([](Population& p) { p.fourier_octaves = 2; }),
                 "maps and Fourier channels make 14");
  expect_refused(with_index([](Population& p) { p.template_mode = static_cast<TemplateMode>(2); }),
                 "population.template_mode", StatusCode::kUnsupported);
  expect_refused(with_index([](Population& p) { p.coding = static_cast<DifferenceCoding>(3); }),
                 "population.coding", StatusCode::kUnsupported);
  expect_refused(with_index([](Population& p) { p.coding = DifferenceCoding::kNone; }),
                 "population.coding: says that nobody differs");
  expect_refused(with_index([](Population& p) { p.coding = DifferenceCoding::kHalf; }),
                 "population.difference: is missing");
  expect_refused(with_index([](Population& p) { p.pose_joints = {2, 2}; }),
                 "population.pose_joints: lists a joint twice");
  expect_refused(with_index([](Population& p) { p.pose_joints = {1, 2}; }),
                 "pose.mean: has shape [3,3], expected [3,6]");
  expect_refused(with_index([](Population& p) { p.quality_names[0] = "a\nb"; }),
                 "population.quality_names[0]");
  expect_refused(with_index([](Population& p) { p.network.layers[3].inputs[0] = 20; }),
                 "input is not an earlier value");
  expect_refused(with_index([](Population& p) { p.body_name = std::string(257, 'a'); }),
                 "population.body_name", StatusCode::kLimitExceeded);
  expect_refused(bent_parts([](PackageParts& parts, Population&, std::vector<Provenance>&) {
                   parts.budget.macs_per_frame = 1;
                 }),
                 "budget.macs_per_frame", StatusCode::kLimitExceeded);
  expect_refused(bent_parts([](PackageParts&, Population&, std::vector<Provenance>& own) {
                   own[1].settings = {{"a\nb", "\x01"}};
                 }),
                 "population.members[1]: settings");
}

TEST(PackagePopulation, SkipsUnknownOptionalBlobsAndRefusesOthers) {
  const uint32_t value = 1;
  for (const bool optional : {true, false}) {
    const Status status = bent_parts([&](PackageParts& parts, Population&,
                                         std::vector<Provenance>&) {
      parts.blobs.push_back(
          {"population.range", DataType::kU32, {1}, std::as_bytes(std::span(&value, 1)), optional});
    });
    EXPECT_EQ(status.ok(), optional) << status.message();
  }
}

}  // namespace
}  // namespace figurine::population_test
