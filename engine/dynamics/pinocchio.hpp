// Included by the sources of this directory only: Pinocchio, with the supported joints.
#pragma once
#include <pinocchio/multibody.hpp>

#include "dynamics.hpp"

namespace hsp {

namespace pin = pinocchio;

// Of the 25 types of Pinocchio's own collection those that a controlled robot can have. Each costs
// compile time; joints that differ only by their axis are `Unaligned`, except the most common ones.
template <class S, int O> struct JointTypes {
  using Scalar = S;
  static constexpr int Options = O;
  using JointModelMimic = pin::JointModelMimicTpl<S, O, JointTypes>;
  using JointDataMimic = pin::JointDataMimicTpl<S, O, JointTypes>;
  using JointModelComposite = pin::JointModelCompositeTpl<S, O, JointTypes>;
  using JointDataComposite = pin::JointDataCompositeTpl<S, O, JointTypes>;
  using JointModelVariant = boost::variant<
      pin::JointModelRevoluteTpl<S, O, 0>, pin::JointModelRevoluteTpl<S, O, 1>,
      pin::JointModelRevoluteTpl<S, O, 2>, pin::JointModelRevoluteUnalignedTpl<S, O>,
      pin::JointModelRevoluteUnboundedUnalignedTpl<S, O>,
      pin::JointModelPrismaticUnalignedTpl<S, O>, pin::JointModelHelicalUnalignedTpl<S, O>,
      pin::JointModelFreeFlyerTpl<S, O>, pin::JointModelSphericalTpl<S, O>,
      pin::JointModelPlanarTpl<S, O>, pin::JointModelTranslationTpl<S, O>,
      boost::recursive_wrapper<JointModelComposite>, boost::recursive_wrapper<JointModelMimic>>;
  using JointDataVariant = boost::variant<
      pin::JointDataRevoluteTpl<S, O, 0>, pin::JointDataRevoluteTpl<S, O, 1>,
      pin::JointDataRevoluteTpl<S, O, 2>, pin::JointDataRevoluteUnalignedTpl<S, O>,
      pin::JointDataRevoluteUnboundedUnalignedTpl<S, O>, pin::JointDataPrismaticUnalignedTpl<S, O>,
      pin::JointDataHelicalUnalignedTpl<S, O>, pin::JointDataFreeFlyerTpl<S, O>,
      pin::JointDataSphericalTpl<S, O>, pin::JointDataPlanarTpl<S, O>,
      pin::JointDataTranslationTpl<S, O>, boost::recursive_wrapper<JointDataComposite>,
      boost::recursive_wrapper<JointDataMimic>>;
};

// Of a body whose inertia about its centre is symmetric but for rounding: Pinocchio's own
// constructor asserts that there is none.
inline pin::Inertia spatial_inertia(double mass, const Vector3& center, const Matrix3& I) {
  const pin::Symmetric3::Vector6 lower{I(0, 0), I(1, 0), I(1, 1), I(2, 0), I(2, 1), I(2, 2)};
  return {mass, center, pin::Symmetric3(lower)};
}

struct Dynamics::Pinocchio {
  using Model = pin::ModelTpl<double, 0, JointTypes>;
  using Data = pin::DataTpl<double, 0, JointTypes>;

  Model model;
  Data data;
  Model::InertiaVector own;  // without payloads
  Vector3 own_gravity;
  std::vector<Carried> carried;
  Data::Matrix6x momenta, momentum_rates;  // of the Jacobian's columns, at the world's origin
  Vector zero;                             // of v's size
  bool allocates = false;                  // see Dynamics
  Eigen::LLT<Eigen::MatrixXd> factor;      // of M, of models with followers

  // Data is made where it stays: its factorisations may not be copied before they are made.
  explicit Pinocchio(const Model& given)
      : model(given),
        data(model),
        own(model.inertias),
        own_gravity(model.gravity.linear()),
        momenta(6, model.nvExtended),
        momentum_rates(6, model.nvExtended),
        zero(Vector::Zero(model.nv)),
        factor(model.nv) {}

  bool has_followers() const { return !model.mimicking_joints.empty(); }
  void joint_jacobians(const ConstVector& q, const ConstVector& v);  // into `data`
  const Data::MatrixXs& mass_matrix(const ConstVector& q);           // both triangles
  void write_mass_matrix_of_followers(const ConstVector& q);
  // At the placements, velocities and Jacobians of `data`.
  void compute_momenta();
  void compute_momentum_rates(bool of_masses);
  template <class Sum, class F> void add_symmetric(Sum& sum, const F& f) const;
  // At the placements and velocities of `data`; u = J v, l = A v/m.
  MassFlow mass_flow(const Vector3& c, const Vector3& u, const Vector3& l) const;
};

inline ConstVector view(const Vector& x) { return {x.data(), x.size()}; }

}  // namespace hsp
