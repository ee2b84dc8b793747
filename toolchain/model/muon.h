// The direction of Muon's step: the (semi-)orthogonal matrix nearest to a momentum matrix, by
// Newton-Schulz iteration.
//
// AdamW scales every weight by itself; Muon makes all directions that a kernel can be moved in move
// equally far, so that rare detail is not left behind what all pictures share.
//
// The iteration X <- aX + b(XX')X + c(XX')(XX')X never leaves the polynomials of X's Gram matrix,
// so it runs on that [rows,rows] matrix alone, in double: for a convolution 32 x 32 instead of 32 x
// 576, and no small singular value drowns in the rounding of squares.
//
// Based on: Jordan et al., Muon: An optimizer for hidden layers in neural networks, 2024 (iteration
// and coefficients).
#pragma once

#include "toolchain/tensor.h"

namespace figurine::model {

// matrix: [rows, columns] float; cheapest with rows <= columns. Returns U f(S) V' of its singular
// value decomposition U S V', where f maps every singular value down to a five hundredth of the
// Frobenius norm to between 0.68 and 1.2; zeros for a matrix of zeros.
torch::Tensor orthogonalised(const torch::Tensor& matrix);

}  // namespace figurine::model
