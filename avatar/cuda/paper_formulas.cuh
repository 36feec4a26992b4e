// Formulas that only recipe `paper` has, of one gaussian, one neighbourhood, one pixel and one frame. As formulas.cuh, the kernels
// and the host test compile this same text; on the CPU it is stages/train/paper/ and stages/train/gaussians/kernels.py.
#pragma once

constexpr int NEAREST = 3;  // gaussians of a neighbourhood

// Scales are largest * sigmoid(logit): the logarithm, and its slope by the logit.
template <class real> FORMULA real log_scale_of(real logit, real largest) { return log(largest) - log(1 + exp(-logit)); }
template <class real> FORMULA real log_scale_slope(real logit) { return 1 / (1 + exp(logit)); }

template <class real> FORMULA real grey(real red, real green, real blue) {
    return real(0.299) * red + real(0.587) * green + real(0.114) * blue;
}

// Strength of the grey image's edge from its differences across and down.
template <class real> FORMULA real strength(real across, real down) { return sqrt(across * across + down * down + real(1e-6)); }

// Slope of weight * |own - target| by a difference of the render, over that difference.
template <class real> FORMULA real strength_slope(real own, real target, real weight) {
    return own == target ? real(0) : (own > target ? weight : -weight) / own;
}

// Dice of the background over a frame of `area` pixels, from sums of alpha, mask and their product. Its slope by the alpha of a
// pixel is by_clear * (1 - mask) - everywhere.
struct Dice { double value, by_clear, everywhere; };

FORMULA Dice dice_of(double area, double shown, double masked, double both, double weight) {
    double neither = area - shown - masked + both, either = fmax(2 * area - shown - masked, 1e-9);
    return {weight * (1 - 2 * neither / either), 2 * weight / either, 2 * weight * neither / (either * either)};
}

// Mean of a neighbourhood's values; slope of weight * their standard deviation by a value, over (value - mean).
template <class real> FORMULA void spread(const real *value, real weight, real &mean, real &slope) {
    mean = 0;
    for (int k = 0; k < NEAREST; ++k) mean += value[k] / NEAREST;
    real square = 0;
    for (int k = 0; k < NEAREST; ++k) square += (value[k] - mean) * (value[k] - mean);
    real deviation = sqrt(square / (NEAREST - 1));
    slope = deviation < real(1e-9) ? real(0) : weight / ((NEAREST - 1) * deviation);
}

// Adam (0.9, 0.999) of one number; rate and unbias: already divided by 1 - 0.9^n and 1 - 0.999^n.
template <class real> FORMULA void adam_value(real &value, real grad, real &first, real &second, real rate, real unbias) {
    first += real(0.1) * (grad - first);
    second += real(0.001) * (grad * grad - second);
    value -= rate * first / (sqrt(second * unbias) + real(1e-15));
}
