#include "toolchain/features/feature_network.h"

#include <filesystem>

#include "figurine/check.h"
#include "figurine/package.h"
#include "ports/host/files.h"
#include "toolchain/error.h"
#include "toolchain/features/figurine_features.h"
#include "toolchain/features/solo_threads.h"
#include "toolchain/features/user_networks.h"

namespace figurine::features {

using measure::Picture;
using measure::RowMatrix;

RgbView RgbPictures::operator[](size_t i) const {
  const size_t values_each = size_t{3} * width_px * height_px;
  return {width_px, height_px, std::span(values).subspan(i * values_each, values_each)};
}

RgbPictures over_grey(std::span<const Picture> pictures) {
  RgbPictures out;
  if (pictures.empty()) return out;
  out.width_px = pictures[0].width_px, out.height_px = pictures[0].height_px;
  const size_t pixels = size_t(out.width_px) * out.height_px;
  out.values.resize(pictures.size() * 3 * pixels);
  for (size_t i = 0; i < pictures.size(); ++i) {
    FIG_CHECK(pictures[i].rgba.size() == 4 * pixels && pictures[i].width_px == out.width_px,
              "pictures of one size");
    for (size_t pixel = 0; pixel < pixels; ++pixel) {
      const uint8_t* p = &pictures[i].rgba[4 * pixel];
      // In half levels, so that mid-grey is exact: 510 is white.
      for (size_t c = 0; c < 3; ++c)
        out.values[(3 * i + c) * pixels + pixel] =
            static_cast<float>(2 * p[c] + 255 - p[3]) / 510.0f;
    }
  }
  return out;
}

RowMatrix FeatureNetwork::features(const RgbPictures& pictures, uint32_t threads) const {
  RowMatrix out(static_cast<Eigen::Index>(pictures.size()), static_cast<Eigen::Index>(dimension()));
  SoloThreads(threads).each(pictures.size(), [&](size_t i) {
    features_of(pictures[i], {out.data() + i * dimension(), dimension()});
  });
  return out;
}

std::vector<std::vector<float>> PerceptualNetwork::embed(const RgbPictures& pictures,
                                                         uint32_t threads) const {
  std::vector<std::vector<float>> out(pictures.size());
  SoloThreads(threads).each(pictures.size(), [&](size_t i) { out[i] = embedding_of(pictures[i]); });
  return out;
}

double PerceptualNetwork::distance(const RgbView& a, const RgbView& b) const {
  FIG_CHECK(a.width_px == b.width_px && a.height_px == b.height_px, "pictures of one size");
  std::vector<float> embeddings[2];
  SoloThreads(1).each(2, [&](size_t i) { embeddings[i] = embedding_of(i == 0 ? a : b); });
  return embedding_distance(embeddings[0], embeddings[1]);
}

RowMatrix PerceptualNetwork::distances(const RgbPictures& a, const RgbPictures& b,
                                       uint32_t threads) const {
  const std::vector<std::vector<float>> rows = embed(a, threads), columns = embed(b, threads);
  RowMatrix out(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(columns.size()));
  SoloThreads(threads).each(rows.size(), [&](size_t i) {
    for (size_t j = 0; j < columns.size(); ++j)
      out.data()[i * columns.size() + j] = embedding_distance(rows[i], columns[j]);
  });
  return out;
}

double embedding_distance(std::span<const float> a, std::span<const float> b) {
  FIG_CHECK(a.size() == b.size(), "embeddings of one network and pictures of one size");
  constexpr size_t kRun =
      8;  // sums side by side, so that the compiler may use vectors without reordering anything
  double sums[kRun] = {};
  size_t i = 0;
  for (; i + kRun <= a.size(); i += kRun) {
    for (size_t k = 0; k < kRun; ++k) {
      const double difference = double(a[i + k]) - b[i + k];
      sums[k] += difference * difference;
    }
  }
  double sum = 0;
  for (; i < a.size(); ++i) sum += (double(a[i]) - b[i]) * (double(a[i]) - b[i]);
  for (const double part : sums) sum += part;
  return sum;
}

std::string hash_of_file(const std::string& path) {
  const Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) throw InputError(file.status().message());
  const std::span<const std::byte> bytes = file.value().bytes();
  return format_hash(hash_picture({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}));
}

LossNetwork open_loss_network(const std::string& path) {
  const auto described = [&](auto network) {
    return LossNetwork{network, network->name(), hash_of_file(path)};
  };
  if (std::filesystem::path(path).extension() == ".safetensors")
    return described(std::make_shared<const FigurineFeatures>(FigurineFeatures::load(path)));
  return described(std::make_shared<const LpipsAlex>(LpipsAlex::load(path)));
}

ComparingNetworks open_networks(const NetworkFiles& files) {
  ComparingNetworks networks;
  if (!files.features.empty()) {
    const auto own =
        std::make_shared<const FigurineFeatures>(FigurineFeatures::load(files.features));
    networks.features.push_back(own);
    networks.perceptual.push_back(own);
  }
  if (!files.lpips.empty())
    networks.perceptual.push_back(std::make_shared<const LpipsAlex>(LpipsAlex::load(files.lpips)));
  if (!files.inception.empty())
    networks.features.push_back(std::make_shared<const InceptionFeatures>(files.inception));
  return networks;
}

}  // namespace figurine::features
