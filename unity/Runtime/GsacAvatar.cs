using System;
using UnityEngine;
using UnityEngine.Events;

namespace Gsac
{
    /// <summary>What moves the joints.</summary>
    public enum GsacSource
    {
        /// <summary>The Animator, by any Humanoid clip, or whatever else turns the transforms.</summary>
        Animator,
        /// <summary>A pose set from script or from the inspector.</summary>
        Script,
        /// <summary>A clip of the .gsac file.</summary>
        Clip,
    }

    /// <summary>
    /// A person: skeleton, poses, expressions. Drawn by the GsacRenderer beside it. Joint rotations in SMPL-X's numbers
    /// (axis-angle in radians, right-handed, y up, person facing +z, left = +x; zero = T-pose) or as Unity quaternions.
    /// Expressions are the blend shapes of the child `Body`, whatever the source of the pose.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Avatar")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(9000)]
    [ExecuteAlways]
    [RequireComponent(typeof(GsacRenderer))]
    public sealed class GsacAvatar : MonoBehaviour
    {
        const float Fade = 0.3f; // s

        [SerializeField, Tooltip("An imported .gsac file.")] GsacAsset asset = null;
        [SerializeField, Tooltip("Or a .gsac file whose name ends in .bytes.")] TextAsset bytes = null;
        [SerializeField] GsacSource source = GsacSource.Animator;
        [SerializeField, HideInInspector] string clip = "";
        [SerializeField, Tooltip("Of clips of the file: 1 as they are, 0 stands, less than 0 plays backwards.")] float speed = 1;
        [SerializeField, Tooltip("Whether clips of the file begin anew after their end.")] GsacLoop loop = GsacLoop.AsInFile;
        [SerializeField, Tooltip("Called when a clip of the file that does not begin anew is over.")] UnityEvent clipEnded = new UnityEvent();

        GsacModel model;
        GsacException fault;
        Transform[] joints;
        SkinnedMeshRenderer body;
        GsacShapes shapes;
        int jaw;
        Animator animator;
        Avatar built; // by this component, not a file's
        byte[] loose;
        GsacPicking picking;
        GsacPose target;
        GsacPose shown;
        GsacPose before;
        GsacClip playing;
        string found;
        float time;
        bool ended;
        float faded = 1;

        /// <summary>
        /// Throws GsacException where the file cannot be read (which is tried once), InvalidOperationException where none is given.
        /// </summary>
        public GsacModel Model
        {
            get
            {
                if (model == null) Open();
                return model;
            }
        }

        public GsacData Data { get { return Model.Data; } }

        /// <summary>In the order of Data.JointNames.</summary>
        public Transform[] Joints { get { return Model == null ? null : joints; } }

        /// <summary>The skinned mesh under the gaussians: its blend shapes are the expressions. Null in edit mode where it was deleted.</summary>
        public SkinnedMeshRenderer Body { get { return Model == null ? null : body; } }

        /// <summary>Weights by Data.Expressions that the next frame draws, the jaw's share added.</summary>
        public float[] DrawnWeights { get; private set; }

        /// <summary>Weights by Data.Expressions, 0..1, as they stand on the body.</summary>
        public GsacShapes Weights { get { return Model == null ? null : shapes; } }

        /// <summary>The pose that the source Script shows. Change it and it is drawn.</summary>
        public GsacPose Pose { get { return Model == null ? null : target; } }

        /// <summary>Whether there is a file that can be read. Opens it.</summary>
        public bool IsOpen
        {
            get
            {
                try
                {
                    if (model == null && fault == null && HasFile) Open();
                }
                catch (GsacException)
                {
                    // kept, and said by the renderer and by whoever asks for the model
                }
                return model != null;
            }
        }

        public bool HasFile { get { return asset != null || bytes != null || loose != null; } }

        /// <summary>Whether the skeleton is there or may be made now: to a scene that is edited nothing is added.</summary>
        public bool CanOpen { get { return HasFile && (Application.isPlaying || transform.childCount > 0); } }

        public GsacSource Source
        {
            get { return source; }
            set
            {
                if (source != value) BeginFade();
                source = value;
            }
        }

        /// <summary>The clip that plays when the source is Clip; the first of the file where this is empty.</summary>
        public string Clip
        {
            get { return clip; }
            set { clip = value ?? ""; }
        }

        /// <summary>Of clips of the file: 1 as they are, 0 stands, less than 0 plays backwards.</summary>
        public float Speed
        {
            get { return speed; }
            set { speed = value; }
        }

        /// <summary>Whether clips of the file begin anew after their end.</summary>
        public GsacLoop Loop
        {
            get { return loop; }
            set { loop = value; }
        }

        /// <summary>Called when a clip of the file that does not begin anew is over.</summary>
        public UnityEvent ClipEnded { get { return clipEnded; } }

        /// <summary>For the importer.</summary>
        public void Use(GsacAsset file)
        {
            Close();
            asset = file;
        }

        /// <summary>
        /// Another person from the bytes of a .gsac file, at run time: in the T-pose, without expression. Joints of the same names stay
        /// the objects that they are, and so does all that is not the avatar's own. Throws GsacException and leaves the person as it is.
        /// </summary>
        public void Use(byte[] file)
        {
            GsacModel next = GsacModel.Acquire(file, file);
            Transform[] old = GsacSkeleton.Find(next.Data, transform);
            if (old != null) GsacSkeleton.Rest(next.Data, old);
            else if (joints != null) GsacSkeleton.Remove(transform, joints);
            Close();
            if (animator != null) animator.avatar = null;
            FreeBuilt();
            target = null;
            loose = file;
            Take(next);
            GsacMesh.Wear(body, next.Body, next.Extent, joints);
            shapes = new GsacShapes(body, next.Data.Expressions);
            shapes.Clear();
        }

        void Open()
        {
            if (!HasFile) throw new InvalidOperationException(name + ": the Gsac Avatar has no file; drag a .gsac asset onto its field `Asset`");
            if (fault != null) throw fault;
            object origin = loose != null ? (object)loose : asset != null ? (object)asset : bytes;
            try
            {
                Take(GsacModel.Acquire(origin, loose ?? (asset != null ? asset.Bytes : bytes.bytes)));
            }
            catch (GsacException e)
            {
                fault = e;
                throw;
            }
        }

        void Take(GsacModel next)
        {
            model = next;
            GsacData data = model.Data;
            joints = GsacSkeleton.Joints(data, transform);
            jaw = data.Joint("jaw");
            body = GsacMesh.Find(transform, joints);
            if (Application.isPlaying)
            {
                if (body == null) body = GsacMesh.Attach(model.Body, model.Extent, transform, joints);
                else if (body.sharedMesh == null) GsacMesh.Wear(body, model.Body, model.Extent, joints); // it went with the model
            }
            shapes = new GsacShapes(body, data.Expressions);
            if (target == null || shown.Rotation.Length != data.JointCount * 4 || DrawnWeights.Length != data.Expressions.Length)
            {
                target = new GsacPose(data.JointCount);
                shown = new GsacPose(data.JointCount);
                before = new GsacPose(data.JointCount);
                DrawnWeights = new float[data.Expressions.Length];
                GsacSkeleton.Read(target, data, joints); // what the scene was saved with
            }
            animator = GetComponent<Animator>();
            if (animator == null) animator = gameObject.AddComponent<Animator>();
            if (animator.avatar == null) animator.avatar = built = GsacHumanoid.Build(data, name);
            found = null;
        }

        /// <summary>Finds the clip that `clip` names, and begins it. One that is not there is said, and none plays.</summary>
        void FindClip()
        {
            playing = null;
            foreach (GsacClip one in model.Data.Clips.Values)
            {
                if (playing == null && string.IsNullOrEmpty(clip) || one.Name == clip) playing = one;
            }
            if (playing == null && !string.IsNullOrEmpty(clip)) Complain();
            found = clip;
            time = speed < 0 && playing != null ? GsacPose.Length(playing, Loops(playing)) : 0;
            ended = false;
        }

        void Complain()
        {
            Debug.LogError(Unknown("clip", clip).Message + "; it has " + string.Join(", ", model.Data.Clips.Keys), this);
        }

        bool Loops(GsacClip one)
        {
            return loop == GsacLoop.AsInFile ? one.Loop : loop == GsacLoop.Always;
        }

        void Close()
        {
            if (model != null) model.Release();
            model = null;
            fault = null;
            var drawn = GetComponent<GsacRenderer>();
            if (drawn != null) drawn.Retry(); // null where the person is being destroyed
        }

        void FreeBuilt()
        {
            GsacCameras.Free(built);
            built = null;
        }

        void OnDisable()
        {
            Dress(false);
            Close();
        }

        /// <summary>Has the body cast shadows and write depth and motion, or takes that from it; one that is not open has none on.</summary>
        internal void Dress(bool on)
        {
            if (model != null && body != null) GsacMesh.Dress(body, on);
        }

        void OnDestroy()
        {
            FreeBuilt();
        }

        /// <summary>"T" or "A", or another still pose of the file.</summary>
        public void ShowPose(string pose)
        {
            GsacClip still;
            if (!Data.Poses.TryGetValue(pose, out still)) throw Unknown("pose", pose);
            Source = GsacSource.Script;
            BeginFade();
            target.Sample(still, 0);
        }

        public void TPose()
        {
            ShowPose("T");
        }

        public void APose()
        {
            ShowPose("A");
        }

        /// <summary>Plays a clip of the file, such as "wave" or "walk".</summary>
        public void PlayClip(string name)
        {
            if (!Data.Clips.ContainsKey(name)) throw Unknown("clip", name);
            Source = GsacSource.Clip;
            BeginFade();
            clip = name;
            FindClip();
        }

        /// <summary>One moment of a clip as a still pose.</summary>
        public void ShowMoment(string name, float seconds)
        {
            GsacClip one;
            if (!Data.Clips.TryGetValue(name, out one)) throw Unknown("clip", name);
            Source = GsacSource.Script;
            BeginFade();
            target.Sample(one, seconds);
        }

        /// <summary>Without a soft change from the pose before.</summary>
        public void SkipFade()
        {
            faded = 1;
        }

        /// <summary>SMPL-X's numbers; an array that is null stays as it is. Lengths: 3, 63, 45, 45, 3, 3, 3.</summary>
        public void SetSmplx(float[] globalOrient, float[] bodyPose, float[] leftHandPose = null, float[] rightHandPose = null,
                             float[] jawPose = null, float[] leftEyePose = null, float[] rightEyePose = null)
        {
            Source = GsacSource.Script;
            GsacPose pose = Pose;
            if (globalOrient != null) pose.SetSmplx(0, globalOrient);
            if (bodyPose != null) pose.SetSmplx(1, bodyPose);
            if (jawPose != null) pose.SetSmplx(22, jawPose);
            if (leftEyePose != null) pose.SetSmplx(23, leftEyePose);
            if (rightEyePose != null) pose.SetSmplx(24, rightEyePose);
            if (leftHandPose != null) pose.SetSmplx(25, leftHandPose);
            if (rightHandPose != null) pose.SetSmplx(40, rightHandPose);
        }

        /// <summary>A joint's rotation relative to its parent, SMPL-X's axis-angle.</summary>
        public void SetJoint(string joint, Vector3 axisAngle)
        {
            Source = GsacSource.Script;
            Pose.SetSmplx(JointIndex(joint), axisAngle.x, axisAngle.y, axisAngle.z);
        }

        /// <summary>A joint's local rotation in Unity's axes.</summary>
        public void SetJoint(string joint, Quaternion local)
        {
            Source = GsacSource.Script;
            int j = JointIndex(joint) * 4;
            Pose.Rotation[j] = local.x;
            Pose.Rotation[j + 1] = local.y;
            Pose.Rotation[j + 2] = local.z;
            Pose.Rotation[j + 3] = local.w;
        }

        /// <summary>Brings a hand or foot from the pose shown to a place in the world, or as near as the limb is long.</summary>
        public void Reach(GsacEnd end, Vector3 place)
        {
            GsacLimb limb = GsacLimb.Find(Data, joints, end);
            if (limb == null) throw Unknown("limb", end.ToString());
            if (source == GsacSource.Script) GsacSkeleton.Apply(target, model.Data, joints);
            Source = GsacSource.Script;
            limb.Reach(place);
            GsacSkeleton.Read(target, model.Data, joints);
        }

        /// <summary>
        /// Where a ray meets the body as it stands now; false where it does not within `farthest` m. Needs no collider. ray: in the world, its
        /// direction of unit length. Some milliseconds for the first ray of a pose: for clicks and touches, not for each pixel.
        /// </summary>
        public bool Raycast(Ray ray, out GsacHit hit, float farthest = float.MaxValue)
        {
            if (picking == null || !ReferenceEquals(picking.Model, Model)) picking = new GsacPicking(Model);
            CollectWeights();
            return picking.Raycast(transform, joints, DrawnWeights, ray, farthest, out hit);
        }

        int JointIndex(string joint)
        {
            int j = Data.Joint(joint);
            if (j < 0) throw Unknown("joint", joint);
            return j;
        }

        /// <summary>weight: 0..1, of one of Data.Expressions (ARKit's names, such as jawOpen).</summary>
        public void SetExpression(string name, float weight)
        {
            int e = Array.IndexOf(Data.Expressions, name);
            if (e < 0) throw Unknown("expression", name);
            Weights[e] = weight;
        }

        public void ClearExpressions()
        {
            Weights.Clear();
        }

        ArgumentException Unknown(string what, string word)
        {
            return new ArgumentException(name + " has no " + what + " `" + word + "`");
        }

        void BeginFade()
        {
            if (joints == null || !Application.isPlaying) return;
            GsacSkeleton.Read(before, Data, joints);
            faded = 0;
        }

        void LateUpdate()
        {
            if (!Application.isPlaying || !IsOpen) return;
            bool animated = source == GsacSource.Animator;
            if (animator.enabled != animated) animator.enabled = animated;
            Refresh(Time.deltaTime);
        }

        /// <summary>Moves the joints of this frame. LateUpdate calls it; in edit mode the inspector does.</summary>
        public void Refresh(float seconds)
        {
            if (Model == null || source == GsacSource.Animator) return;
            if (source == GsacSource.Clip) Play(seconds);
            else shown.Copy(target);
            if (faded < 1)
            {
                faded = Math.Min(1, faded + seconds / Fade);
                shown.MixFrom(before, faded * faded * (3 - 2 * faded));
            }
            GsacSkeleton.Apply(shown, model.Data, joints);
        }

        /// <summary>Fills `shown` from the clip, `seconds` after the frame before.</summary>
        void Play(float seconds)
        {
            // set by whatever sets a field: inspector, undo, script
            if (found != clip)
            {
                if (found != null) BeginFade();
                FindClip();
            }
            if (playing == null)
            {
                shown.Copy(target);
                return;
            }
            bool loops = Loops(playing);
            float length = GsacPose.Length(playing, loops);
            time += seconds * speed;
            bool over = speed > 0 && time >= length || speed < 0 && time <= 0;
            if (loops && length > 0) time -= (float)Math.Floor(time / length) * length;
            else time = Mathf.Clamp(time, 0, length);
            shown.Sample(playing, time, loops);
            if (!over || loops || ended) return;
            ended = true;
            clipEnded.Invoke();
        }

        /// <summary>Fills DrawnWeights; the renderer calls it.</summary>
        public void CollectWeights()
        {
            shapes.Read(DrawnWeights);
            if (jaw < 0) return;
            Quaternion q = joints[jaw].localRotation;
            GsacPose.ToAxisAngle(ref q.x, ref q.y, ref q.z, q.w);
            GsacPose.AddJaw(model.Data, q.x, q.y, q.z, DrawnWeights);
            shapes.ShowJaw(q.x, q.y, q.z);
        }
    }
}
