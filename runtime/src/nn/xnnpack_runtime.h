// Owns an XNNPACK runtime, for headers that need not know XNNPACK.
#pragma once

#include <memory>

struct xnn_runtime;

namespace figurine {

struct XnnRuntimeDeleter {
  void operator()(xnn_runtime* runtime) const;
};
using XnnRuntime = std::unique_ptr<xnn_runtime, XnnRuntimeDeleter>;

}  // namespace figurine
