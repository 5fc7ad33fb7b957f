/** @file
 *  What the tests of this folder share: random numbers, random systems, and what is known of them. In double precision, whatever the library
 *  computes in, and compiled once. */
#ifndef HULLGUARD_TESTS_PROBLEM_HPP
#define HULLGUARD_TESTS_PROBLEM_HPP

#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <setjmp.h>
#include <string>
#include <vector>

extern "C" {
#include <cmocka.h>
}

namespace problem {

using oracle::Matrix;
using oracle::Vector;
using std::size_t;

constexpr double unit_double = std::numeric_limits<double>::epsilon();
inline int       problems = 300; /* of each kind; begin_run() in tables.hpp */

/* ---- Small tools ---- */

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double real(double low, double high) { return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53); }
    int    whole(int low, int high) { return static_cast<int>(integer(low, high)); }
    bool   chance(double p) { return real(0.0, 1.0) < p; }
    std::int64_t integer(std::int64_t low, std::int64_t high)
    {
        return low + static_cast<std::int64_t>(engine_() % static_cast<std::uint64_t>(high - low + 1));
    }
    Matrix matrix(Eigen::Index rows, Eigen::Index cols)
    {
        return Matrix::NullaryExpr(rows, cols, [this]() { return real(-1.0, 1.0); });
    }

private:
    std::mt19937_64 engine_;
};

inline std::uint64_t the_seed = 0;

/* One stream a test, so that a test repeats alone. */
inline Random stream(std::uint64_t test) { return Random(the_seed * 1000003U + test); }

inline std::string say(const char *format, ...) __attribute__((format(printf, 1, 2)));
inline std::string say(const char *format, ...)
{
    char    text[600];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return text;
}

/* Only here may cmocka jump out: nothing with a destructor is alive above the caller's result. */
inline void expect_clean(const std::string &failure)
{
    if (!failure.empty()) {
        fail_msg("HULLGUARD_SEED=%llu: %s", static_cast<unsigned long long>(the_seed), failure.c_str());
    }
}

double spectral_radius(const Matrix &m);

Matrix beside(const Matrix &a, const Matrix &b);

/* ---- Random generators ---- */

/* Real, complex, repeated and defective eigenvalues within the radius, seen from a random basis. */
Matrix random_stable(Random &random, Eigen::Index n, double radius);

/* Stable observer and stable post-filter: one of the two gets the random poles, the other follows while Lo is small enough. */
oracle::Generator random_generator(Random &random);

/* A linear system as the library's tables describe one, with the magnitudes its coefficients were summed from. */
struct System {
    Matrix A, B, C, D;
    Matrix A_abs, B_abs, C_abs, D_abs;
};

System plain(const Matrix &A, const Matrix &B, const Matrix &C, const Matrix &D);

/* residual.h; platoon, section 3, "Fused form" */
System fused(const oracle::Generator &g);

System observer(const oracle::Generator &g);
System filter(const oracle::Generator &g);

/* Observer and filter in series as one system of twice the order, for its rounding bound. */
System series(const oracle::Generator &g);

/* Rounding bound of a run (platoon, section 8). A row of n products, its coefficients rounded too, is wrong by at most (n + 2) units of
 *  sum |a||x| (Higham's gamma); coefficients that are themselves sums of `inner` products add as many. One step's error e then reaches r as
 *  sum over lags of |C A^j| e. Units are doubled (unit is epsilon, not epsilon / 2), which covers second order terms. */
Vector rounding(const System &s, Eigen::Index inner, const Vector &state_max, const Vector &input_max, double epsilon);

std::vector<std::uint8_t> identity_places(Eigen::Index n);

/* Distinct places of `width` signals in a vector of `of`. */
std::vector<std::uint8_t> random_places(Random &random, Eigen::Index width, Eigen::Index of);

/* ---- b) The hull ---- */

/* |h_ig(taps_g + j)| <= weight (residuals x signals) x decay_i^j for all j >= 0 */
struct Tail {
    Vector decay;
    Matrix weight;
    bool   modal = false;
};

using Taps = std::vector<int>; /* of each signal */

/* A = S Lam S^-1: |Lam|, |S^-1 B|, |C S| */
struct Spectrum {
    Vector decay;
    Matrix input, output;
};

Spectrum spectrum_of(const System &s);

/* platoon, section 6: h(lag) = C A^(lag-1) B, A = S Lam S^-1 */
Tail modal_tail(const System &s, const Taps &taps);

/* For a defective A: |A^q| = beta < 1, so |A^n| <= (max of |A^b|, b < q) beta^floor(n/q), and floor(n/q) >= (n - q + 1) / q. */
Tail power_tail(const System &s, const Taps &taps);

/* Is A = S Lam S^-1 to be trusted? Not when S is nearly singular, and for a double eigenvalue whose imaginary parts vanish in rounding Eigen
 *  hands out columns that are no eigenvectors at all. */
bool diagonalisable(const Matrix &A);

/* Residuals may forget slower than they must, each at a pace of its own; none at once, or it could take nothing over. Behind no taps at all
 *  stands |h(0)| = |D| too: what is behind one tap bounds the rest, a sample later. */
Tail tail_of(Random &random, const System &s, const Taps &taps);

/* What the initial state and the disturbances add to a threshold: sample by sample, and what a tail takes over then. */
struct Bias {
    Matrix rest, moving; /* samples x residuals */
    Vector rest_left, moving_left, later; /* left: what theta is given at the end of the tables */
};

/* ---- Plant, observer, post-filter and threshold together ---- */

/* A full-order observer in random coordinates T: T A - G T = L C, H = T B - L D, V C = W T with W = C T^-1, V = I, Qu = D
 *  (platoon, section 2), and any post-filter that is stable. */
struct Loop {
    oracle::Plant     plant;
    oracle::Generator generator;
    Matrix            T;
    Vector            initial;
};

void draw_observer(Random &random, Loop &l);

Loop random_loop(Random &random);

/* a(k) by the other route, that of the error e = T x - z (platoon, section 5): the oracle must find the same by simulation. */
Matrix bias_by_error(const Loop &l, int rows);

} // namespace problem

#endif
