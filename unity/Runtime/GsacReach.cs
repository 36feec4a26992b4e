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

        /// <summary>A limb, how it stood before it was moved, and how it was left.</summary>
        struct Held
        {
            public GsacLimb Limb;
            public bool Moved;
            public Quaternion Upper, Middle, Tip, UpperLeft, MiddleLeft, TipLeft;
        }

        readonly Held[] limbs = new Held[GsacLimb.Ends.Length];
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
            for (int i = 0; i < limbs.Length; i++) limbs[i] = new Held { Limb = GsacLimb.Find(avatar.Data, joints, GsacLimb.Ends[i]) };
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
                if (limbs[i].Limb == null) continue;
                GiveBack(ref limbs[i]);
                if (goals[i] != null && weight > 0) Reach(ref limbs[i], goals[i]);
            }
        }

        /// <summary>Where nothing else has moved a limb since, it stands again as before: or it would turn on from frame to frame.</summary>
        static void GiveBack(ref Held held)
        {
            GsacLimb limb = held.Limb;
            if (!held.Moved) return;
            held.Moved = false;
            if (Same(limb.Upper.localRotation, held.UpperLeft)) limb.Upper.localRotation = held.Upper;
            if (Same(limb.Middle.localRotation, held.MiddleLeft)) limb.Middle.localRotation = held.Middle;
            if (Same(limb.Tip.localRotation, held.TipLeft)) limb.Tip.localRotation = held.Tip;
        }

        void Reach(ref Held held, Transform goal)
        {
            GsacLimb limb = held.Limb;
            held.Upper = limb.Upper.localRotation;
            held.Middle = limb.Middle.localRotation;
            held.Tip = limb.Tip.localRotation;
            Vector3 from = limb.Tip.position;
            limb.Reach(from + (goal.position - from) * weight);
            if (turn) limb.Tip.rotation = Quaternion.Slerp(limb.Tip.rotation, goal.rotation, weight);
            held.UpperLeft = limb.Upper.localRotation;
            held.MiddleLeft = limb.Middle.localRotation;
            held.TipLeft = limb.Tip.localRotation;
            held.Moved = true;
        }

        static bool Same(Quaternion a, Quaternion b)
        {
            return a.x == b.x && a.y == b.y && a.z == b.z && a.w == b.w;
        }
    }
}
