using System;

namespace Gsac
{
    /// <summary>A pose and expression weights of which only some are known: those that were named.</summary>
    public sealed class GsacLivePose
    {
        public readonly GsacPose Pose;
        public readonly float[] Weights;
        public readonly bool[] HasJoint;
        public readonly bool[] HasWeight;
        public bool HasTransl;

        public GsacLivePose(GsacData data)
        {
            Pose = new GsacPose(data.JointCount);
            Weights = new float[data.Expressions.Length];
            HasJoint = new bool[data.JointCount];
            HasWeight = new bool[Weights.Length];
        }

        public void Copy(GsacLivePose other)
        {
            Pose.Copy(other.Pose);
            Array.Copy(other.Weights, Weights, Weights.Length);
            Array.Copy(other.HasJoint, HasJoint, HasJoint.Length);
            Array.Copy(other.HasWeight, HasWeight, HasWeight.Length);
            HasTransl = other.HasTransl;
        }
    }
}
