/** @file
 *  What the polynomial filter must compute, once more: double precision, written from the method note (polynomial, sections 2.2 and 2.3, form FPF) and the text of
 *  polynomial.h. Polynomials are rows over full Kronecker powers of s = (xi, w, v), each its own tensor, multiplied by Kronecker products: x1 x2 and x2 x1 are two entries
 *  until the end. The covariance of the noise is summed over pairs of the noise's monomials as the note has it, the auxiliary filter's covariance is its shorter form, gains
 *  come from inverses. Beside each number stands the sum of the magnitudes it was made of, products by the rule of differentials: the first-order bound of what roundings of
 *  a number type can have changed it by in one sample is so many units times that. */
#ifndef HULLGUARD_ORACLE_POLYNOMIAL_HPP
#define HULLGUARD_ORACLE_POLYNOMIAL_HPP

#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

namespace oracle {

using std::size_t;
using Tuple = std::vector<int>; /* variables of a monomial, in ascending order */

/* ---- the plant ---- */

struct Term {
    double coefficient;
    Tuple  factor; /* states */
};
using Rows = std::vector<std::vector<Term>>;

struct Noise {
    double variance;
    bool   skewed; /* exponential without its mean, or normal */

    double moment(int order) const
    {
        double normal = 1.0, exponential = 1.0; /* (k - 1)!!, and !k = k !(k - 1) + (-1)^k */
        for (int k = 1; k <= order; ++k) {
            normal = (k % 2 == 0) ? normal * (k - 1) : normal;
            exponential = k * exponential + ((k % 2 == 0) ? 1.0 : -1.0);
        }
        normal = (order % 2 == 0) ? normal : 0.0;
        return std::pow(variance, 0.5 * order) * (skewed ? exponential : normal);
    }
};

struct PolynomialPlant {
    Rows               f, h;
    std::vector<Noise> noise; /* of w, then of v */
    Vector             x0, P0; /* mean and variances, normal */

    int states() const { return static_cast<int>(f.size()); }
    int outputs() const { return static_cast<int>(h.size()); }
};

inline double evaluate(const std::vector<Term> &row, const Vector &x)
{
    double sum = 0.0;
    for (const Term &t : row) {
        double product = t.coefficient;
        for (int i : t.factor) {
            product *= x(i);
        }
        sum += product;
    }
    return sum;
}

/* ---- monomials ---- */

/** All tuples of so many variables up to a degree, shortest first, each length in lexicographic order. */
inline std::vector<Tuple> tuples(int variables, int degree)
{
    std::vector<Tuple> found{{}};
    for (size_t begin = 0, length = 1; length <= static_cast<size_t>(degree); ++length) {
        const size_t end = found.size();
        for (size_t t = begin; t < end; ++t) {
            for (int v = found[t].empty() ? 0 : found[t].back(); v < variables; ++v) {
                found.push_back(found[t]);
                found.back().push_back(v);
            }
        }
        begin = end;
    }
    return found;
}

inline std::map<Tuple, int> places(const std::vector<Tuple> &list)
{
    std::map<Tuple, int> found;
    for (size_t i = 0; i < list.size(); ++i) {
        found[list[i]] = static_cast<int>(i);
    }
    return found;
}

/* ---- polynomials as Kronecker rows ---- */

struct Series {
    std::vector<Vector> value, size; /* [k] over the k-th Kronecker power */

    Series(int variables, int degree)
    {
        Eigen::Index entries = 1;
        for (int k = 0; k <= degree; ++k, entries *= variables) {
            value.push_back(Vector::Zero(entries));
            size.push_back(Vector::Zero(entries));
        }
    }
    void add(int degree, Eigen::Index at, double x, double magnitude)
    {
        value[static_cast<size_t>(degree)](at) += x;
        size[static_cast<size_t>(degree)](at) += magnitude;
    }
    /* += factor other, the factor itself of this magnitude */
    void add(const Series &other, double factor, double magnitude)
    {
        for (size_t k = 0; k < value.size(); ++k) {
            value[k] += factor * other.value[k];
            size[k] += std::abs(factor) * other.size[k] + magnitude * other.value[k].cwiseAbs();
        }
    }
    double drop_constant()
    {
        const double constant = value[0](0);
        value[0](0) = 0.0;
        size[0](0) = 0.0;
        return constant;
    }
};

inline void add_kronecker(Vector &sum, const Vector &a, const Vector &b)
{
    for (Eigen::Index i = 0; i < a.size(); ++i) {
        if (a(i) != 0.0) {
            sum.segment(i * b.size(), b.size()) += a(i) * b;
        }
    }
}

inline Series operator*(const Series &a, const Series &b)
{
    Series c = a;
    for (size_t k = 0; k < c.value.size(); ++k) {
        c.value[k].setZero();
        c.size[k].setZero();
        for (size_t i = 0; i <= k; ++i) {
            const Vector abs_a = a.value[i].cwiseAbs(), abs_b = b.value[k - i].cwiseAbs();
            add_kronecker(c.value[k], a.value[i], b.value[k - i]);
            add_kronecker(c.size[k], abs_a, b.size[k - i]);
            add_kronecker(c.size[k], a.size[i], abs_b);
        }
    }
    return c;
}

/* A number or a matrix with its magnitude. */
struct Sized {
    Matrix value, size;
};

inline Sized operator*(const Sized &a, const Sized &b)
{
    return {a.value * b.value, a.size * b.value.cwiseAbs() + a.value.cwiseAbs() * b.size};
}

inline Sized operator+(const Sized &a, const Sized &b) { return {a.value + b.value, a.size + b.size}; }

inline Sized exact(const Matrix &m) { return {m, m.cwiseAbs()}; }

inline Sized transposed(const Sized &a) { return {a.value.transpose(), a.size.transpose()}; }

/* X S^-1 for a symmetric S that is factored: X changes by dX S^-1 - X S^-1 dS S^-1, and the factors of S are those of a matrix that differs by roundings of
 * sqrt(S_ii S_jj), once for each row. */
inline Sized divided(const Sized &X, const Sized &S)
{
    const Matrix inverse = S.value.inverse(), quotient = X.value * inverse;
    const Vector root = S.value.diagonal().cwiseSqrt();
    const Matrix spread = S.size + static_cast<double>(S.value.rows()) * (root * root.transpose());
    return {quotient, (X.size + quotient.cwiseAbs() * spread) * inverse.cwiseAbs()};
}

/* ---- the filter ---- */

struct PolynomialLevels {
    double kappa = 4.47, weight = 0.125, reach = 3.0;
    Vector box, fresh;
};

class PolynomialFilter {
public:
    PolynomialFilter(const PolynomialPlant &plant, int degree, bool bounded, const PolynomialLevels &levels);
    void step(const Vector &y, const Vector &radius); /* infinite radius: unknown */

    std::vector<Tuple> X, Y; /* monomials of the states with 1, of the outputs without */
    Sized  c, Pe, z, P, M;   /* prediction for the next sample; z and M with the 1 */
    Vector mean;
    Sized  x, Px, ekf;       /* of this sample */
    double plain = 0.0, threshold = 0.0, drift = 0.0;
    Sized  joint;
    bool   held = false;
    bool   tie = false;      /* a decision was too near to tell what another number type makes of it */

    Matrix moments() const; /* E [1; X][1; X]' before the first sample */
    double mean_of(const Tuple &a, const Tuple &b) const;
    double covariance_of(const Tuple &a, const Tuple &b) const { return mean_of(a, b) - mean_of(a, {}) * mean_of(b, {}); }
    double root_of_square(const Tuple &b) const { return std::sqrt(mean_of(b, b)); }

private:
    Series put_in(const std::vector<Term> &row, const std::vector<Series> &states) const;
    void   auxiliary(const Vector &y, const Vector &radius, std::vector<Series> &H, std::vector<Series> &F);
    void   split(const std::vector<Series> &rows);
    Sized  noise_covariance() const;
    Sized  remainders() const;
    Sized  join(const Sized &linear, const Sized &N, double &bound, double &bound_size) const;
    struct Heard {
        Sized            Y, Delta;
        std::vector<int> used, judged; /* places in Y, places in used */
        int              silent;
        double           d, d_size;
    };
    struct Gained {
        Sized  move, move_f, taken, taken_f; /* of the prediction, _f of the estimate */
        double wider;
    };

    Matrix slope_at(const Vector &at) const;
    static std::vector<Series> powers(const std::vector<Tuple> &of, const std::vector<Series> &variables);
    Sized  moments_after(const Sized &linear, const Sized &covariance) const;
    std::vector<bool> worth(const Vector &radius, const Sized &J);
    Heard  hear(const Vector &radius, const Sized &J);
    Sized  spread(const Heard &h, const Sized &J, const std::vector<int> &rows) const;
    void   judge(const Vector &radius, const Sized &r, const Sized &J);
    Gained gain(const Heard &h, const Sized &linear, const Sized &J, const Sized &r, double bound, double bound_size);
    void   update(const Vector &radius, const Sized &whole, const Sized &J, double bound, double bound_size);

    int                n_, p_, mu_, all_, top_; /* all: variables of s */
    PolynomialPlant    plant_;
    PolynomialLevels   levels_;
    bool               bounded_;
    struct Correlated {
        size_t a, b;
        double covariance;
    };

    std::vector<Tuple> noises_, ring_;
    std::vector<double> noise_mean_;
    std::vector<Correlated> correlated_;
    std::vector<size_t> noise_at_; /* [ring] up to degree mu: monomial of the noise and */
    std::vector<int>    state_at_; /* [ring]   of the states */
    std::vector<double> root_; /* [ring] of the noise's mean square */
    std::map<Tuple, int> state_place_;
    std::vector<std::vector<int>> collected_; /* [degree][entry of the Kronecker power] place of the monomial in the ring */
    std::vector<std::pair<Tuple, Tuple>> parts_; /* [ring] states, noises from 0 on */
    Sized              eta_;
    std::vector<Sized> by_noise_; /* [noise monomial] rows x (N + 1) */
    Sized              cut_;      /* rows x ring */
};

} // namespace oracle

#endif
