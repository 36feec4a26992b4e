using UnityEngine;

namespace Gsac
{
    /// <summary>Hands and feet go where objects are, over whatever else moves the person: trackers, handles, things to hold.</summary>
    [AddComponentMenu("Gsac/Gsac Reach")]
    [DefaultExecutionOrder(9600)] // after the avatar and its stream, before it is drawn
    [RequireComponent(typeof(GsacAvatar))]
    public sealed class GsacReach : MonoBehaviour
    {
        [SerializeField] Transform leftHand = null;
        [SerializeField] Transform rightHand = null;
        [SerializeField] Transform leftFoot = null;
        [SerializeField] Transform rightFoot = null;
        [SerializeField, Tooltip("0..1: how far they go.")] float weight = 1;
        [SerializeField, Tooltip("Wrists and ankles turn as the objects do: without rotation they stand as in the T-pose.")]
        bool turn = false;

        readonly GsacLimb[] limbs = new GsacLimb[GsacLimb.Ends.Length];
        readonly Transform[] goals = new Transform[GsacLimb.Ends.Length];
        GsacAvatar avatar;
        Transform[] joints;

        /// <summary>0..1: how far hands and feet go.</summary>
        public float Weight
        {
            get { return weight; }
            set { weight = value; }
        }

        /// <summary>Whether wrists and ankles turn as the objects do.</summary>
        public bool Turn
        {
            get { return turn; }
            set { turn = value; }
        }

        /// <summary>goal: null leaves the hand or foot where it is.</summary>
        public void SetGoal(GsacEnd end, Transform goal)
        {
            if (end == GsacEnd.LeftHand) leftHand = goal;
            else if (end == GsacEnd.RightHand) rightHand = goal;
            else if (end == GsacEnd.LeftFoot) leftFoot = goal;
            else rightFoot = goal;
        }

        void Prepare()
        {
            joints = avatar.Joints;
            for (int i = 0; i < limbs.Length; i++) limbs[i] = GsacLimb.Find(avatar.Data, joints, GsacLimb.Ends[i]);
        }

        void LateUpdate()
        {
            if (avatar == null) avatar = GetComponent<GsacAvatar>();
            if (!avatar.IsOpen) return;
            if (!ReferenceEquals(joints, avatar.Joints)) Prepare();
            goals[(int)GsacEnd.LeftHand] = leftHand;
            goals[(int)GsacEnd.RightHand] = rightHand;
            goals[(int)GsacEnd.LeftFoot] = leftFoot;
            goals[(int)GsacEnd.RightFoot] = rightFoot;
            for (int i = 0; i < limbs.Length; i++)
            {
                if (goals[i] == null || limbs[i] == null || weight <= 0) continue;
                Transform tip = limbs[i].Tip;
                Vector3 from = tip.position;
                limbs[i].Reach(from + (goals[i].position - from) * weight);
                if (turn) tip.rotation = Quaternion.Slerp(tip.rotation, goals[i].rotation, weight);
            }
        }
    }
}
