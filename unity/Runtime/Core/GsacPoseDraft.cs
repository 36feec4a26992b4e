using System;
using System.Text;

namespace Gsac
{
    /// <summary>
    /// A pose and expression weights while a message is read into them: taken over only once the message is known to be whole.
    /// Names are looked up in the message's bytes, so that nothing is allocated.
    /// </summary>
    public sealed class GsacPoseDraft
    {
        const float MaxValue = 1000;
        static readonly byte[][] GroupNames = Bytes("global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose",
                                                    "left_hand_pose", "right_hand_pose");
        static readonly int[] GroupFirst = { 0, 1, 22, 23, 24, 25, 40 };
        static readonly int[] GroupJoints = { 1, 21, 1, 1, 1, 15, 15 };

        /// <summary>Where readers put the numbers of a key or an address.</summary>
        public readonly float[] Row;

        readonly byte[][] joints, bones, expressions;
        readonly float pelvisY, pelvisZ;
        readonly GsacLivePose draft;
        readonly GsacPose pose;
        bool camera, turned, moved;

        /// <summary>data: in Unity's axes.</summary>
        public GsacPoseDraft(GsacData data)
        {
            joints = Bytes(data.JointNames);
            string[] human = GsacHumanBones.Names(data.JointNames);
            for (int j = 0; j < human.Length; j++) human[j] = human[j] == null ? "" : human[j].Replace(" ", "");
            bones = Bytes(human);
            expressions = Bytes(data.Expressions);
            draft = new GsacLivePose(data);
            pose = draft.Pose;
            Row = new float[Math.Max(63, expressions.Length)];
            pelvisY = data.Joints[1];
            pelvisZ = data.Joints[2];
        }

        public static byte[][] Bytes(params string[] names)
        {
            var all = new byte[names.Length][];
            for (int i = 0; i < names.Length; i++) all[i] = Encoding.UTF8.GetBytes(names[i]);
            return all;
        }

        public void Begin(GsacLivePose from)
        {
            camera = turned = moved = false;
            draft.Copy(from);
        }

        public void End(GsacLivePose into)
        {
            if (camera) pose.UprightFromCamera(turned, moved, pelvisY, pelvisZ);
            into.Copy(draft);
        }

        /// <summary>Whether the root's numbers of this message are of a camera's frame.</summary>
        public bool Camera { set { camera = value; } }

        public int Expressions { get { return expressions.Length; } }

        /// <summary>Number of the group of joints that text[first..last] names, -1 for none.</summary>
        public int Group(byte[] text, int first, int last) { return Find(GroupNames, text, first, last); }

        public int Joint(byte[] text, int first, int last) { return Find(joints, text, first, last); }

        /// <summary>By Unity's name of the bone without blanks, as HumanBodyBones and VMC spell it.</summary>
        public int Bone(byte[] text, int first, int last) { return Find(bones, text, first, last); }

        /// <summary>Capitals count as small letters: ARKit's jawOpen is others' JawOpen.</summary>
        public int Expression(byte[] text, int first, int last) { return Find(expressions, text, first, last, 32); }

        /// <summary>How many numbers of the row a group takes; 0 where this skeleton lacks its joints.</summary>
        public int GroupLength(int group)
        {
            return GroupFirst[group] + GroupJoints[group] <= joints.Length ? GroupJoints[group] * 3 : 0;
        }

        public void SetGroup(int group)
        {
            for (int j = 0; j < GroupJoints[group]; j++) SetJoint(GroupFirst[group] + j, j * 3);
        }

        /// <summary>SMPL-X's axis-angle from Row[first] on.</summary>
        public void SetJoint(int joint, int first)
        {
            pose.SetSmplx(joint, Row[first], Row[first + 1], Row[first + 2]);
            draft.HasJoint[joint] = true;
            turned |= joint == 0;
        }

        public void SetTransl()
        {
            pose.SetSmplxTransl(Row[0], Row[1], Row[2]);
            draft.HasTransl = moved = true;
        }

        /// <summary>A quaternion x y z w in Unity's axes from Row[first] on. False where it is zero.</summary>
        public bool SetRotation(int joint, int first)
        {
            double length = 0;
            for (int i = first; i < first + 4; i++) length += (double)Row[i] * Row[i];
            length = Math.Sqrt(length);
            if (!(length > 1e-3)) return false;
            for (int i = 0; i < 4; i++) pose.Rotation[joint * 4 + i] = (float)(Row[first + i] / length);
            return draft.HasJoint[joint] = true;
        }

        public void SetExpression(int expression, float weight)
        {
            draft.Weights[expression] = weight;
            draft.HasWeight[expression] = true;
        }

        public void SetExpressions()
        {
            for (int e = 0; e < expressions.Length; e++) SetExpression(e, Row[e]);
        }

        public static bool Plain(float value) { return value >= -MaxValue && value <= MaxValue; }

        /// <summary>Which of `names` text[first..last] is, -1 for none; fold: bits that do not count.</summary>
        public static int Find(byte[][] names, byte[] text, int first, int last, int fold = 0)
        {
            if (first >= last) return -1;
            for (int n = 0; n < names.Length; n++)
            {
                byte[] name = names[n];
                if (name.Length != last - first) continue;
                int i = 0;
                while (i < name.Length && (name[i] | fold) == (text[first + i] | fold)) i++;
                if (i == name.Length) return n;
            }
            return -1;
        }
    }
}
